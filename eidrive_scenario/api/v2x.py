"""Channels: the transmission of messages between stations.

Stable: `Channel`, `LinkChannel`, `ChannelProfile`, `Message`, `ReceivedMessage`, `LinkEvent`. The columns of outcomes
(`LinkEvents`, `OutcomeBlock`, `OutcomeColumns`) may change with a minor version.
"""

from eidrive_scenario.v2x.channel import Channel
from eidrive_scenario.v2x.link_channel import LinkChannel
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage
from eidrive_scenario.v2x.profile import ChannelProfile
from eidrive_scenario.v2x.statistics.link_events import LinkEvents, OutcomeBlock, OutcomeColumns

__all__ = [
    "Channel",
    "ChannelProfile",
    "LinkChannel",
    "LinkEvent",
    "LinkEvents",
    "Message",
    "OutcomeBlock",
    "OutcomeColumns",
    "ReceivedMessage",
]
