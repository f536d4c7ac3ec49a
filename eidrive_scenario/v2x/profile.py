"""Channel profiles: what a person writes about the radio, and the channel made of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from eidrive_scenario.errors import Diagnostic, RegistryError, SettingError, quoted, suggestion
from eidrive_scenario.files.bounded import is_regular_file
from eidrive_scenario.openscenario.values.parameters import Scope
from eidrive_scenario.openscenario.values.references import is_reference, resolve_references
from eidrive_scenario.registry import construct, registry
from eidrive_scenario.settings import Settings, key_lines, load_yaml, load_yaml_file, parse_settings
from eidrive_scenario.v2x.channel import Channel

NO_COOPERATION = "none"
"""The profile without any channel: stations hear nobody, and see with their own sensors undisturbed."""

SUFFIXES = (".yaml", ".yml")


class ChannelProfile(Settings):
    """What every channel model has in common; each model adds its own settings in a class of its own.

    model           name of the channel model (entry point `eidrive_scenario.channels`)
    own_perception  true: a station's own detections travel the channel too, as a link from the station to itself, and
                    are delayed and lost like those of others; then not even they are heard in the tick they were said
    """

    model: str = "composed"
    name: str = ""
    description: str = ""
    own_perception: bool = False


def load_profile(
    source: str | Path | Mapping[str, Any],
    folders: Sequence[Path] = (),
    *,
    origin: str = "",
    line: int | None = None,
    scope: Scope | None = None,
) -> ChannelProfile | None:
    """A checked profile: by name, by path, from YAML text, or from a mapping. None stands for no cooperation.

    A text that is a mapping in YAML (`{delay: {kind: constant, seconds: 0.3}}`) is read as such; any other is the name
    of a `.yaml` file in one of `folders` (first match), or a path: relative to the folder of the file `origin`, to the
    working directory or to `folders` (first match). `origin` and `line` say where the source itself was written;
    `scope` holds the parameters to which settings refer as `$name` or `${expression}`, or the text itself, which then
    is a name or a path. Raises SettingError with file, line and key.
    """
    if isinstance(source, Mapping):
        return _parse(source, "custom", origin or "channel", line, {}, scope)
    if isinstance(source, str) and is_reference(source.strip()) and scope is not None:
        source = Path(str(resolve_references(source.strip(), scope, source=origin, line=line)).strip())
        if str(source) == NO_COOPERATION:
            return None
    if isinstance(source, str):
        text = source.strip()
        if text == NO_COOPERATION:
            return None
        if "{" in text or "\n" in text or ": " in text:
            data = load_yaml(source, source=origin or "channel", line=line)
            lines = {} if line is None else key_lines(source, line)
            return _parse(_mapping(data, origin or "channel", line), "custom", origin or "channel", line, lines, scope)
        if not text:
            raise SettingError(Diagnostic("the channel has no name", "write `ideal`, or `none`", origin, line))
        source = Path(text)
    path = _find(source, Path(origin).parent, folders)
    if path is None:
        names = {found.stem for folder in folders for found in _profiles(folder)} | {NO_COOPERATION}
        kind = "file" if source.suffix in SUFFIXES else "channel profile"
        what = f"no {kind} {quoted(str(source))}"
        hint = suggestion(source.stem, names)
        if is_regular_file(source):
            what, hint = f"the file {quoted(str(source))} is no channel profile", "give one that ends in .yaml"
        raise SettingError(Diagnostic(what, hint, origin, line))
    data, lines = load_yaml_file(path)
    return _parse(_mapping(data, str(path), 1), path.stem, str(path), 1, lines, scope, folder=path.parent)


def profile_names(folder: Path) -> tuple[str, ...]:
    """The names of the profiles in a folder, sorted; `none` is always there."""
    return tuple(sorted({NO_COOPERATION, *(path.stem for path in _profiles(folder))}))


def build_channel(profile: ChannelProfile | None, seed: int, previous: Channel | None = None) -> Channel | None:
    """The channel of a profile, None where there is none.

    `previous` is the channel that this one replaces during a run: what is on its way there arrives by its old fate.
    """
    if profile is None:
        return None
    channel: Channel = construct(registry("channels").load(profile.model, Channel), profile, seed)
    if previous is not None:
        channel.continue_from(previous)
    return channel


def _profiles(folder: Path) -> list[Path]:
    return [path for suffix in SUFFIXES for path in folder.glob(f"*{suffix}")]


def _find(source: Path, beside: Path, folders: Sequence[Path]) -> Path | None:
    if source.suffix in SUFFIXES:
        candidates = [beside / source, source, *(folder / source for folder in folders)]
    else:
        candidates = [folder / f"{source}{suffix}" for folder in folders for suffix in SUFFIXES]
    return next((path for path in candidates if is_regular_file(path)), None)


def _with_paths(data: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The settings of a profile with every `file` in it relative to the profile's own folder."""
    placed = dict(data)
    for key, value in data.items():
        if isinstance(value, Mapping):
            placed[key] = _with_paths(value, folder)
        elif key == "file" and isinstance(value, str):
            placed[key] = str(folder / value)
    return placed


def _mapping(data: Any, source: str, line: int | None) -> Mapping[str, Any]:
    if not isinstance(data, Mapping):
        found = f"found {type(data).__name__}" if data is not None else "it is empty"
        raise SettingError(
            Diagnostic(f"a channel profile is a mapping, {found}", "write `model: composed`", source, line)
        )
    return data


def _parse(
    data: Mapping[str, Any],
    name: str,
    source: str,
    line: int | None,
    lines: Mapping[str, int],
    scope: Scope | None,
    folder: Path | None = None,
) -> ChannelProfile:
    data = resolve_references(data, scope, source=source, line=line, lines=lines)
    data = _with_paths(data, folder) if folder is not None else data
    model = data.get("model", ChannelProfile.model_fields["model"].default)
    models = registry("channels")
    if not isinstance(model, str) or model not in models:
        diagnostic = Diagnostic(
            f"unknown channel model {quoted(model)}", suggestion(str(model), models), source, lines.get("model", line)
        )
        raise SettingError(diagnostic)
    settings = getattr(models.load(model, Channel), "settings", None)
    if not (isinstance(settings, type) and issubclass(settings, ChannelProfile)):
        raise RegistryError(f"the channel model {model!r} has no `settings`, a class derived from ChannelProfile")
    profile = parse_settings(settings, data, source=source, line=line, lines=lines)
    return profile if profile.name else profile.model_copy(update={"name": name})
