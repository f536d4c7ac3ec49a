"""Building blocks of the networks."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval


class ConvUnit(nn.Module):
    """Convolution, batch normalization (Ioffe and Szegedy 2015), SiLU (Elfwing et al. 2018)."""

    def __init__(
        self,
        inputs: int,
        outputs: int,
        kernel: int = 1,
        stride: int = 1,
        *,
        groups: int = 1,
        padding: int | None = None,
    ) -> None:
        super().__init__()
        pad = kernel // 2 if padding is None else padding
        self.conv = nn.Conv2d(inputs, outputs, kernel, stride, pad, groups=groups, bias=False)
        self.norm: nn.Module = nn.BatchNorm2d(outputs, eps=1e-3, momentum=0.03)
        self.act = nn.SiLU(inplace=True)

    def forward(self, x: Tensor) -> Tensor:
        out: Tensor = self.act(self.norm(self.conv(x)))
        return out

    def fold(self) -> None:
        """Fold the normalization into the weights of the convolution; for inference only."""
        if isinstance(self.norm, nn.BatchNorm2d):
            self.conv = fuse_conv_bn_eval(self.conv, self.norm.eval())
            self.norm = nn.Identity()


class FastConvolution(nn.Module):
    """Convolution by oneDNN, for inference on a CPU.

    With one thread, PyTorch uses another implementation for 1x1 kernels; this one took half the time in measurements.
    """

    def __init__(self, conv: nn.Conv2d) -> None:
        super().__init__()
        self.weight, self.bias = conv.weight, conv.bias
        self._padding = [int(side) for side in conv.padding]
        self._stride, self._dilation, self._groups = conv.stride, conv.dilation, conv.groups

    def forward(self, x: Tensor) -> Tensor:
        return torch.mkldnn_convolution(
            x, self.weight, self.bias, self._padding, self._stride, self._dilation, self._groups
        )


def fold(network: nn.Module, *, fast_convolutions: bool = True) -> None:
    """Prepare the network for inference: fold normalizations into convolutions, and use the fastest convolutions.

    The network cannot be trained afterwards.

    fast_convolutions  whether to use the fastest convolutions of a CPU, which no GPU supports
    """
    network.eval()
    network.requires_grad_(False)
    for module in list(network.modules()):
        if isinstance(module, ConvUnit):
            module.fold()
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    if fast_convolutions and torch.backends.mkldnn.is_available():  # type: ignore[no-untyped-call]
        _use_fast_convolutions(network)


def _use_fast_convolutions(module: nn.Module) -> None:
    for name, child in module.named_children():
        if isinstance(child, nn.Conv2d):
            setattr(module, name, FastConvolution(child))
        else:
            _use_fast_convolutions(child)


class Bottleneck(nn.Module):
    """1x1, then 3x3 convolution, with an optional residual connection (He et al. 2016)."""

    def __init__(self, channels: int, *, shortcut: bool) -> None:
        super().__init__()
        self.reduce = ConvUnit(channels, channels, 1)
        self.widen = ConvUnit(channels, channels, 3)
        self.shortcut = shortcut

    def forward(self, x: Tensor) -> Tensor:
        out: Tensor = self.widen(self.reduce(x))
        return x + out if self.shortcut else out


class CrossStage(nn.Module):
    """Cross-stage partial block: half of the channels bypass the bottlenecks (Wang et al., CSPNet 2020)."""

    around: ConvUnit

    def __init__(self, inputs: int, outputs: int, depth: int, *, shortcut: bool = True) -> None:
        super().__init__()
        half = outputs // 2
        self.through = ConvUnit(inputs, half)
        self.add_module("around", ConvUnit(inputs, half))  # a key of the weight files
        self.stages = nn.Sequential(*(Bottleneck(half, shortcut=shortcut) for _ in range(depth)))
        self.merge = ConvUnit(2 * half, outputs)

    def forward(self, x: Tensor) -> Tensor:
        out: Tensor = self.merge(torch.cat([self.stages(self.through(x)), self.around(x)], dim=1))
        return out


class PyramidPooling(nn.Module):
    """Spatial pyramid pooling (He et al. 2015) as three successive 5x5 poolings, which cover 5, 9 and 13 cells."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.reduce = ConvUnit(channels, channels // 2)
        self.pool = nn.MaxPool2d(5, stride=1, padding=2)
        self.merge = ConvUnit(2 * channels, channels)

    def forward(self, x: Tensor) -> Tensor:
        x = self.reduce(x)
        near = self.pool(x)
        far = self.pool(near)
        out: Tensor = self.merge(torch.cat([x, near, far, self.pool(far)], dim=1))
        return out


class SeparableUnit(nn.Module):
    """Depthwise 3x3, then pointwise 1x1 (Howard et al., MobileNets 2017); residual connection if the shapes permit."""

    def __init__(self, inputs: int, outputs: int, stride: int = 1) -> None:
        super().__init__()
        self.depthwise = ConvUnit(inputs, inputs, 3, stride, groups=inputs)
        self.pointwise = ConvUnit(inputs, outputs, 1)
        self.shortcut = stride == 1 and inputs == outputs

    def forward(self, x: Tensor) -> Tensor:
        out: Tensor = self.pointwise(self.depthwise(x))
        return x + out if self.shortcut else out
