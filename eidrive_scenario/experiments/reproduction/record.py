"""Record of a part: a file with one line of JSON per episode, from which an interrupted reproduction continues."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import BinaryIO, Self

import msgspec

from eidrive_scenario.errors import Diagnostic, SettingError
from eidrive_scenario.experiments.reproduction.episodes import Episode
from eidrive_scenario.files.atomic import exclusive


class Record:
    """Episodes of a record file, and the open file to which further ones are added."""

    def __init__(self, stream: BinaryIO, episodes: dict[tuple[str, str, int, str], Episode]) -> None:
        self._stream = stream
        self.episodes = episodes
        """Episodes by their key."""

    def add(self, episode: Episode) -> None:
        """Add an episode to the file. It is complete on the disk after the return, so that a kill loses no other."""
        self._stream.write(msgspec.json.encode(episode) + b"\n")
        self._stream.flush()
        self.episodes[episode.key] = episode

    @classmethod
    @contextmanager
    def open(cls, path: Path, *, restart: bool = False) -> Iterator[Self]:
        """Open a record and lock it against other processes; `restart` discards its episodes.

        An incomplete last line, as a killed process leaves it, is removed. Raise SettingError if any other line is
        invalid, if the file cannot be written, or if another process writes it.
        """
        if path.exists() and not path.is_file():
            raise SettingError(Diagnostic("cannot write: not a regular file", "choose another folder", str(path)))
        with ExitStack() as stack:
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                stack.enter_context(exclusive(path))
                stream = stack.enter_context(path.open("ab"))
                content = b"" if restart else path.read_bytes()
            except OSError as error:
                message = f"cannot write: {error.strerror}"
                raise SettingError(Diagnostic(message, "choose another folder", str(path))) from error
            complete = content[: content.rfind(b"\n") + 1]
            episodes = _parse(path, complete)
            stream.truncate(len(complete))
            yield cls(stream, episodes)


def _parse(path: Path, content: bytes) -> dict[tuple[str, str, int, str], Episode]:
    episodes = {}
    for number, line in enumerate(content.splitlines(), 1):
        try:
            episode = msgspec.json.decode(line, type=Episode)
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            hint = "remove the line, or start again with --restart"
            raise SettingError(Diagnostic(f"the record is damaged: {error}", hint, str(path), number)) from error
        episodes[episode.key] = episode
    return episodes
