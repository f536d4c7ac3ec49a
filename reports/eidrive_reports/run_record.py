"""Record of the runs of a study, so that an interrupted study is continued."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from contextlib import ExitStack, contextmanager
from operator import attrgetter
from pathlib import Path
from typing import BinaryIO, ClassVar, Generic, Self, TypeVar

import msgspec

from eidrive_scenario.api.common import Diagnostic, SettingError, exclusive

R = TypeVar("R")


class RunRecord(Generic[R]):
    """Runs of a record file by their key, and the open file to which further ones are added, one JSON object per line.

    kind  class of the runs
    key   fields of a run, and of its job, that identify it
    hint  what a user does about a damaged line
    """

    kind: ClassVar[type]
    key: ClassVar[attrgetter[Hashable]]
    hint: ClassVar[str]

    def __init__(self, stream: BinaryIO, runs: dict[Hashable, R]) -> None:
        self._stream = stream
        self.runs = runs

    def add(self, run: R) -> None:
        """Add a run to the file. It is complete on the disk after the return, so that a kill loses no other."""
        self._stream.write(self.encode(run) + b"\n")
        self._stream.flush()
        self.runs[self.key(run)] = run

    def encode(self, run: R) -> bytes:
        """Return the line of a run."""
        return msgspec.json.encode(run)

    @classmethod
    @contextmanager
    def open(cls, path: Path, *, restart: bool = False) -> Iterator[Self]:
        """Open a record and lock it against other processes; `restart` discards its runs.

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
            runs: dict[Hashable, R] = {}
            for number, line in enumerate(complete.splitlines(), 1):
                try:
                    run: R = msgspec.json.decode(line, type=cls.kind)
                except (msgspec.DecodeError, UnicodeDecodeError) as error:
                    message = f"the record is damaged: {error}"
                    raise SettingError(Diagnostic(message, cls.hint, str(path), number)) from error
                runs[cls.key(run)] = run
            stream.truncate(len(complete))
            yield cls(stream, runs)
