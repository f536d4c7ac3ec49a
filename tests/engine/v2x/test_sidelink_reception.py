"""Sidelinks: collisions, half-duplex operation, control channel, and link statistics."""

from __future__ import annotations

from collections import Counter

import pytest
from radio_traffic import DT, message, radio
from sidelink_traffic import MODE_2, MODE_4, Air, many

from eidrive_scenario.v2x.messages.message import LinkEvent
from eidrive_scenario.v2x.radio_environment import RadioEnvironment


@pytest.mark.exhaustive
def test_collisions_between_sensing_stations_are_rare() -> None:
    """60 stations share 400 resources: after the first seconds only selections in the same 100 ms collide."""
    places = many(60)
    air = Air(radio(5, **MODE_4), places, 0.1, listeners=4).run(30.0, dict.fromkeys(places, 1))
    late = [event for event in air.events if event.sent > 4.0]
    reasons = Counter(event.reason for event in late)
    assert set(reasons) <= {"", "half_duplex", "collision", "propagation"}
    assert 0 < reasons["collision"] / len(late) < 0.05, "random choice among 400 resources would lose 14 %"
    assert reasons["half_duplex"] / len(late) == pytest.approx(0.01, abs=0.008)


@pytest.mark.parametrize("background", [None, {"kind": "cv2x_mode4", "density": 0.05}])
def test_half_duplex_stations_do_not_receive_while_transmitting(background: dict[str, str | float] | None) -> None:
    """Two stations with resources in the same subframe lose the messages of each other in both directions."""
    air = Air(radio(5, **MODE_4, background=background), many(10), 0.1).run(40.0, dict.fromkeys(many(10), 1))
    subframe = {(e.message.sender, e.message.number): round(1000 * e.start) for e in air.transmissions}
    sent = {(sender, start) for (sender, _), start in subframe.items()}
    for event in air.events:
        start = subframe.get((event.sender, event.number))
        if start is not None:
            assert (event.reason == "half_duplex") == ((event.receiver, start) in sent)


def test_message_without_decoded_control_information_is_lost() -> None:
    """Receivers at 100 to 2,900 m: without decoded control information a message is not received."""
    places = {"A": (0.0, 0.0, 1.5), **{f"R{n}": (100.0 * n, 0.0, 1.5) for n in range(1, 30)}}
    robust, weak = (
        Air(radio(1, **MODE_4, tx_power_dbm=5, sidelink={"pscch_errors": curve}), places, 0.1).run(20.0, {"A": 1})
        for curve in ("pscch", "80211p_goubet")
    )
    delivered = [sum(e.outcome == "delivered" for e in air.events) for air in (robust, weak)]
    assert delivered[1] < delivered[0]
    assert {e.reason for e in weak.events} <= {"", "propagation", "sensing"}


@pytest.mark.parametrize("sidelink", [MODE_4, {**MODE_2, "nr_sidelink": {"transmissions": 3}}], ids=["4", "2"])
def test_link_statistics_with_entering_and_leaving_stations_are_complete(sidelink: dict[str, object]) -> None:
    """A station enters or leaves every fourth tick; every message is counted."""
    carrier = radio(2, **sidelink, queue={"discipline": "lcfs"})
    all_places = many(12, 20.0)
    events: list[LinkEvent] = []
    sent = 0
    for tick in range(240):
        now = DT * tick
        places = {name: place for row, (name, place) in enumerate(all_places.items()) if (tick // 4) % (row + 2) != 1}
        carrier.update_environment(RadioEnvironment(places))
        for name in places:
            carrier.deliver(name, now)
        outbox = [
            (message(name, tick, now, 190 + 100 * (tick % 5)), [n for n in places if n != name]) for name in places
        ]
        sent += sum(len(receivers) for _, receivers in outbox)
        events += carrier.transmit(outbox, now)
    statistics = carrier.statistics(240 * DT).values()
    assert sum(link.sent for link in statistics) == sent
    assert all(link.sent == link.received + link.lost + link.in_flight for link in statistics)
    assert {event.reason for event in events} >= {"", "absent", "queue", "half_duplex"}
