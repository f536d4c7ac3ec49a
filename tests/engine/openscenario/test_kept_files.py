"""Contents of files that stay in the process."""

from __future__ import annotations

from eidrive_scenario.openscenario.reading.parsing import KeptFiles


def test_least_recently_used_values_are_removed() -> None:
    kept: KeptFiles[str, int] = KeptFiles(10)
    for number, name in enumerate("abc"):
        kept.put(name, number, 4)
        kept.get("a")
    assert [kept.get(name) for name in "abc"] == [0, None, 2]


def test_file_above_the_maximum_removes_no_other() -> None:
    kept: KeptFiles[str, int] = KeptFiles(10)
    kept.put("small", 1, 4)
    kept.put("large", 2, 11)
    assert (kept.get("small"), kept.get("large")) == (1, None)


def test_value_of_a_key_is_replaced() -> None:
    kept: KeptFiles[str, int] = KeptFiles(10)
    for number in range(5):
        kept.put("one", number, 8)
    assert kept.get("one") == 4
