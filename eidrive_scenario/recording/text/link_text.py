"""The fate of a message in words."""

from __future__ import annotations

from eidrive_scenario.v2x.messages.message import LinkEvent

OFF_THE_AIR = frozenset({"queue", "absent"})
"""Why a message is lost on a radio that never went on the air."""

_SIGHT = {"los": "nothing in between", "nlosv": "behind", "nlos": "behind a building or the ground"}


def describe_link(link: LinkEvent) -> str:
    """Who said what to whom, whether it arrived, and what the radio did: `RSU to Ego, message 7: lost: busy; …`.

    Path loss with shadowing and bodies in between [dB], ratio of signal to noise [dB].
    """
    fate = f"arrives at {link.arrives:.4f} s" if link.arrives is not None else f"lost: {link.reason.replace('_', ' ')}"
    told = f"{link.sender} to {link.receiver}, message {link.number}: {fate}"
    if link.path_loss_db is None or link.snr_db is None or link.los is None:
        return told
    bodies = ", ".join(link.blockers)
    sight = _SIGHT[link.los] + (f" {bodies}" if link.los == "nlosv" else f", and {bodies}" if bodies else "")
    radio = f"path loss {link.path_loss_db:.1f} dB, signal to noise {link.snr_db:.1f} dB"
    return f"{told}; {radio}, {link.los.upper().replace('NLOSV', 'NLOSv')}: {sight}"
