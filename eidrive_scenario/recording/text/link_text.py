"""Text description of the outcome of a message."""

from __future__ import annotations

from eidrive_scenario.v2x.messages.message import LinkEvent, Message

NOT_TRANSMITTED = frozenset({"queue", "absent"})
"""Loss reasons of messages that a radio never transmitted."""

_SIGHT = {"los": "no obstacle", "nlosv": "behind", "nlos": "behind a building or the ground"}


def describe_expired(message: Message) -> str:
    """Return the text about a received message that is too old: `message 7 of RSU is not used: it is too old; …`."""
    text = f"message {message.number} of {message.sender} is not used: it is too old on arrival"
    return f"{text}; measured at {message.detections.time:.3f} s by the clock of {message.sender}"


def describe_link(link: LinkEvent) -> str:
    """Return sender, receiver, outcome and radio conditions of a message: `RSU to Ego, message 7: lost: busy; …`.

    Radio conditions are the path loss with shadowing and blockage [dB] and the signal-to-noise ratio [dB].
    """
    arrival = f"arrives at {link.arrives:.4f} s" if link.arrives is not None else ""
    outcome = arrival or f"lost: {link.reason.replace('_', ' ')}"
    text = f"{link.sender} to {link.receiver}, message {link.number}: {outcome}"
    if link.path_loss_db is None or link.snr_db is None or link.los is None:
        return text
    bodies = ", ".join(link.blockers)
    sight = _SIGHT[link.los] + (f" {bodies}" if link.los == "nlosv" else f", and {bodies}" if bodies else "")
    radio = f"path loss {link.path_loss_db:.1f} dB, signal to noise {link.snr_db:.1f} dB"
    return f"{text}; {radio}, {link.los.upper().replace('NLOSV', 'NLOSv')}: {sight}"
