"""Network `pillars`: its graph against plain convolutions, and the errors of unsuitable weights."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from pillar_weights import CLASSES, SHAPES, Arrays, plain_arrays, random_arrays, save

from eidrive_scenario.errors import SettingError
from eidrive_scenario.perception.learned.network_loading import build_network
from eidrive_scenario.perception.learned.pillars.detector import PillarDetector, PillarSettings
from eidrive_scenario.perception.learned.pillars.network import PillarNetwork, features_onnx
from eidrive_scenario.perception.learned.runtimes import GraphRuntime, is_installed, load_onnx
from eidrive_scenario.perception.learned.settings import LearnedSettings

RUNTIMES = pytest.mark.parametrize("runtime", get_args(GraphRuntime))


def need(runtime: GraphRuntime) -> None:
    if not is_installed(runtime):
        pytest.skip(f"needs {runtime}")


def sparse_grid(seed: int = 1) -> np.ndarray:
    """Return a grid with values in every twentieth cell."""
    rng = np.random.default_rng(seed)
    return (rng.uniform(-0.5, 1.5, (12, 256, 256)) * (rng.random((256, 256)) < 0.05)).astype(np.float32)


def convolve(values: np.ndarray, arrays: Arrays, name: str, stride: int = 1) -> np.ndarray:
    """Return a convolution with zero padding and ReLU, as a sum over the kernel, in double precision."""
    weight = arrays[f"{name}.weight"].astype(float)
    pad = weight.shape[2] // 2
    padded = np.pad(values, ((0, 0), (pad, pad), (pad, pad)))
    n = values.shape[1] // stride
    total = np.zeros((len(weight), n, n)) + arrays[f"{name}.bias"][:, None, None]
    for i in range(weight.shape[2]):
        for j in range(weight.shape[3]):
            part = padded[:, i : i + stride * (n - 1) + 1 : stride, j : j + stride * (n - 1) + 1 : stride]
            total += np.tensordot(weight[:, :, i, j], part, axes=1)
    return np.asarray(np.maximum(total, 0.0))


def enlarge(values: np.ndarray, arrays: Arrays, name: str) -> np.ndarray:
    """Return a transposed convolution whose stride is its kernel size, and ReLU: each cell fills a square."""
    weight = arrays[f"{name}.weight"].astype(float)
    factor, n = weight.shape[2], values.shape[1]
    total = np.empty((weight.shape[1], n * factor, n * factor))
    for i in range(factor):
        for j in range(factor):
            total[:, i::factor, j::factor] = np.tensordot(weight[:, :, i, j].T, values, axes=1)
    return np.asarray(np.maximum(total + arrays[f"{name}.bias"][:, None, None], 0.0))


def stated_features(grid: np.ndarray, arrays: Arrays) -> np.ndarray:
    x, levels = grid.astype(float), []
    for block, depth in enumerate((1, 2, 4)):
        x = convolve(x, arrays, f"block{block}.0", 2)
        for layer in range(1, depth + 1):
            x = convolve(x, arrays, f"block{block}.{layer}")
        levels.append((convolve if block == 0 else enlarge)(x, arrays, f"up{block}"))
    return np.concatenate(levels)


@RUNTIMES
def test_features_equal_plain_convolutions(runtime: GraphRuntime) -> None:
    need(runtime)
    arrays, grid = random_arrays(), sparse_grid()
    compute = load_onnx(runtime, Path("random.npz"), 1, features_onnx(arrays))
    (features,) = compute(grid[None])
    expected = stated_features(grid, arrays)
    assert features.shape == (1, 96, 128, 128)
    assert 0.05 < expected.std() < 5.0
    np.testing.assert_allclose(features[0], expected, atol=2e-4)


def test_features_model_passes_checker_of_onnx() -> None:
    onnx = pytest.importorskip("onnx", reason="needs the extra 'dev'")
    onnx.checker.check_model(onnx.load_from_string(features_onnx(random_arrays())), full_check=True)


@RUNTIMES
def test_features_of_same_grid_have_equal_bits(runtime: GraphRuntime, tmp_path: Path) -> None:
    need(runtime)
    path, grid = save(tmp_path / "random.npz", random_arrays()), sparse_grid()
    first, second = PillarNetwork(path, runtime), PillarNetwork(path, runtime)
    features = first.features(grid)
    for network in (first, second):
        np.testing.assert_array_equal(network.features(grid), features)
        np.testing.assert_array_equal(network.objects(features), first.objects(features))


def test_last_layers_equal_matrix_products(tmp_path: Path) -> None:
    arrays = random_arrays()
    network = PillarNetwork(save(tmp_path / "random.npz", arrays), "opencv")
    features = np.maximum(np.random.default_rng(2).normal(size=(96, 128, 128)), 0.0).astype(np.float32)
    for name, layer in (("head", network.objects), ("compress", network.compress)):
        weight = arrays[f"{name}.weight"][:, :, 0, 0].astype(float)
        expected = np.einsum("oc,cij->oij", weight, features) + arrays[f"{name}.bias"][:, None, None]
        np.testing.assert_allclose(layer(features), expected, atol=1e-4)


def test_integer_features_are_similar(tmp_path: Path) -> None:
    """Each of nine layers rounds to 255 steps; the weights have 63 steps."""
    need("openvino")
    arrays, grid = random_arrays(), sparse_grid()
    layers = [f"relu_{number}" for number in range(1, 27, 2)]
    path = save(tmp_path / "random.npz", arrays, ranges={name: [0.0, 4.0] for name in layers})
    single, integer = (PillarNetwork(path, "openvino", precision).features(grid) for precision in ("float32", "int8"))
    error = np.sqrt(np.mean(np.square(integer - single)))
    assert 1e-4 < error < 0.1 * single.std()


def test_integer_features_without_ranges_raise_error(tmp_path: Path) -> None:
    path = save(tmp_path / "random.npz", random_arrays())
    with pytest.raises(SettingError, match="its layers have no ranges for int8"):
        PillarNetwork(path, "openvino", "int8")


@pytest.mark.parametrize("name", [*(f"{name}.weight" for name in SHAPES), "up1.bias", "codebook", "latent_scale"])
def test_missing_or_wrong_array_raises_error(name: str, tmp_path: Path) -> None:
    arrays = plain_arrays()
    arrays[name] = np.zeros((*np.shape(arrays[name]), 2), dtype=np.float32)
    with pytest.raises(SettingError, match=rf"do not fit: {name} has another shape than the network"):
        PillarNetwork(save(tmp_path / "a.npz", arrays), "opencv")
    del arrays[name]
    with pytest.raises(SettingError, match=rf"do not fit: {name} is missing"):
        PillarNetwork(save(tmp_path / "b.npz", arrays), "opencv")


@pytest.mark.parametrize(
    ("description", "diagnostic"),
    [
        ({"network": "ssd"}, r"are of another network \(got 'ssd'; expected 'pillars'\); use the detector 'ssd'"),
        ({"network": "mine"}, "its description specifies no known network"),
        ({"input_size": [256, 128]}, "its input size is invalid (expected 256 x 256)"),
        ({"input_size": [0, 256]}, "its description has no usable input size or classes"),
        ({"classes": [*CLASSES[:6], "person"]}, "its class 'person' is unknown (expected some of car, truck, bus"),
        ({"classes": CLASSES[:6]}, "head.weight has another shape than the network"),
        ({"classes": []}, "its description has no usable input size or classes"),
        ({"confidence": 1.0}, "its confidence is invalid (got 1"),
    ],
)
def test_unsuitable_description_raises_error(description: dict[str, Any], diagnostic: str, tmp_path: Path) -> None:
    path = save(tmp_path / "weights.npz", plain_arrays(), **description)
    with pytest.raises(SettingError) as error:
        PillarDetector(PillarSettings(weights=str(path))).load_weights()
    assert diagnostic.replace("\\", "") in str(error.value)


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, np.inf])
def test_unsuitable_latent_scale_raises_error(scale: float, tmp_path: Path) -> None:
    path = save(tmp_path / "weights.npz", plain_arrays() | {"latent_scale": np.float32(scale)})
    with pytest.raises(SettingError, match=r"latent_scale is invalid .*expected a positive number"):
        PillarNetwork(path, "opencv")


@pytest.mark.parametrize("share", [0.0, 0.3, 0.95])
def test_truncated_file_raises_error(share: float, tmp_path: Path) -> None:
    content = save(tmp_path / "weights.npz", plain_arrays()).read_bytes()
    (tmp_path / "cut.npz").write_bytes(content[: int(share * len(content))])
    with pytest.raises(
        SettingError, match=r"cut.npz' do not fit: .*; use the shipped weights, or a .npz with the arrays"
    ):
        PillarNetwork(tmp_path / "cut.npz", "opencv")


def test_missing_file_raises_error_with_hint() -> None:
    with pytest.raises(SettingError, match=r"no file 'nowhere.npz' with weights; check `weights`"):
        PillarDetector(PillarSettings(weights="nowhere.npz"))


def test_image_detector_refuses_weights_of_pillars(tmp_path: Path) -> None:
    path = save(tmp_path / "weights.npz", plain_arrays())
    with pytest.raises(SettingError, match="its network 'pillars' processes no images"):
        build_network("ssd", LearnedSettings(weights=str(path)))
