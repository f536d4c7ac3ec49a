"""Channel profiles: settings of a channel model, and the channel built from them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from eidrive_scenario.errors import Diagnostic, SettingError, quoted, suggestion
from eidrive_scenario.extensions.library import library_path, names
from eidrive_scenario.extensions.registry import construct, registry
from eidrive_scenario.extensions.settings import Settings, parse_settings, settings_type_of
from eidrive_scenario.files.bounded import is_regular_file, path_argument
from eidrive_scenario.files.similar_paths import file_suggestion
from eidrive_scenario.files.yaml_text import load_yaml_file, load_yaml_text
from eidrive_scenario.openscenario.values.parameters import Scope, is_reference, parameter_hints, resolve_references
from eidrive_scenario.v2x.channel import Channel

NO_COOPERATION = "none"
"""Name of the profile without a channel: stations receive no messages, and their own perception is unaffected."""

SUFFIXES = (".yaml", ".yml")


class ChannelProfile(Settings):
    """Settings common to all channel models. Each model adds its settings in a subclass.

    model           name of the channel model (entry point `eidrive_scenario.channels`)
    own_perception  true: the channel also carries the own detections of a station, on a link from the station to
                    itself; they are delayed and lost like messages, and never delivered in the tick of generation
    """

    model: str = "composed"
    name: str = ""
    description: str = ""
    own_perception: bool = False


def load_profile(
    source: str | os.PathLike[str] | Mapping[str, Any],
    *,
    origin: str = "",
    line: int | None = None,
    scope: Scope | None = None,
) -> ChannelProfile | None:
    """Return a validated profile, by name, by path, from YAML text or from a mapping; None for no cooperation.

    source  YAML mapping as text (`{delay: {kind: constant, seconds: 0.3}}`), name of a profile of the library, or path
            relative to the folder of `origin`, to the working directory or to the library; the first match applies
    origin, line  file and line of the source, for messages
    scope   parameters for references `$name` and `${expression}` in settings; `source` may also be such a reference

    Raise SettingError with file, line and key if the profile is invalid.
    """
    if isinstance(source, Mapping):
        return _parse(source, "custom", origin or "channel", line, {}, scope)
    if not isinstance(source, str):
        source = path_argument(source, "source", "the name, the file or the mapping of a channel profile")
    source = _named_by_reference(source, origin, line, scope)
    if str(source).strip() == NO_COOPERATION:
        return None
    if isinstance(source, str):
        text = source.strip()
        if _is_inline(text):
            data, lines = load_yaml_text(source, source=origin or "channel", line=line)
            return _parse(data, "custom", origin or "channel", line, {} if line is None else lines, scope)
        if not text:
            message = "channel name is empty"
            raise SettingError(Diagnostic(message, "expected a profile such as `ideal`, or `none`", origin, line))
        source = Path(text)
    path = _find(source, Path(origin).parent)
    if path is None:
        kind = "file" if source.suffix in SUFFIXES else "channel profile"
        message = f"no {kind} {quoted(str(source))}"
        hint = file_suggestion(source, SUFFIXES, [*names("channels"), NO_COOPERATION], folder=Path(origin).parent)
        if is_regular_file(source):
            message, hint = f"file {quoted(str(source))} is not a channel profile", "expected a file name in .yaml"
        raise SettingError(Diagnostic(message, hint, origin, line))
    data, lines = load_yaml_file(path)
    return _parse(data, path.stem, str(path), 1, lines, scope, folder=path.parent)


def profile_file(source: str | Path, *, origin: str = "", scope: Scope | None = None) -> Path | None:
    """Return the file of a profile that `load_profile` reads; None for a YAML text, and if there is no such file.

    Raise SettingError for an invalid reference.
    """
    source = _named_by_reference(source, origin, None, scope)
    if isinstance(source, str) and _is_inline(source.strip()):
        return None
    return _find(Path(str(source).strip()), Path(origin).parent)


def _named_by_reference(source: str | Path, origin: str, line: int | None, scope: Scope | None) -> str | Path:
    """Return the path or name to which a reference such as `$Channel` refers; another source unchanged."""
    if isinstance(source, str) and is_reference(source.strip()) and scope is not None:
        return Path(str(resolve_references(source.strip(), scope, source=origin, line=line)).strip())
    return source


def _is_inline(text: str) -> bool:
    return "{" in text or "\n" in text or ": " in text


def build_channel(profile: ChannelProfile | None, seed: int, previous: Channel | None = None) -> Channel | None:
    """Return the channel of a profile; None without a profile.

    previous  channel that is replaced during a run; its messages in flight keep their outcome

    Raise SettingError for an object that is no profile, such as its name.
    """
    if profile is None:
        return None
    if not isinstance(profile, ChannelProfile):
        raise SettingError(Diagnostic(f"profile is {quoted(profile)}", "give the result of load_profile"))
    channel: Channel = construct(registry("channels").load(profile.model, Channel), profile, seed)
    if previous is not None:
        channel.continue_from(previous)
    return channel


def _find(source: Path, beside: Path) -> Path | None:
    library = library_path() / "channels"
    if source.suffix in SUFFIXES:
        candidates = [beside / source, source, library / source]
    else:
        candidates = [library / f"{source}{suffix}" for suffix in SUFFIXES]
    return next((path for path in candidates if is_regular_file(path)), None)


def _with_paths(data: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return the settings of a profile with every `file` resolved relative to the folder of the profile."""
    resolved = dict(data)
    for key, value in data.items():
        if isinstance(value, Mapping):
            resolved[key] = _with_paths(value, folder)
        elif key == "file" and isinstance(value, str):
            resolved[key] = str(folder / value)
    return resolved


def _parse(
    data: Any,
    name: str,
    source: str,
    line: int | None,
    lines: Mapping[str, int],
    scope: Scope | None,
    folder: Path | None = None,
) -> ChannelProfile:
    if not isinstance(data, Mapping):
        given = type(data).__name__ if data is not None else "an empty file"
        message = f"channel profile is not a mapping (got {given})"
        raise SettingError(Diagnostic(message, "expected settings such as `model: composed`", source, line))
    origins = parameter_hints(data, scope)
    data = resolve_references(data, scope, source=source, line=line, lines=lines)
    data = _with_paths(data, folder) if folder is not None else data
    model = data.get("model", ChannelProfile.model_fields["model"].default)
    models = registry("channels")
    if not isinstance(model, str) or model not in models:
        message, hint = f"unknown channel model {quoted(model)}", suggestion(str(model), models)
        raise SettingError(Diagnostic(message, hint, source, lines.get("model", line)))
    settings_type = settings_type_of("channels", model, models.load(model, Channel), ChannelProfile)
    profile = parse_settings(settings_type, data, source=source, line=line, lines=lines, origins=origins)
    return profile if profile.name else profile.model_copy(update={"name": name})
