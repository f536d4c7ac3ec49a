"""Channels: the transmission of messages between stations.

Stable: `Channel`, `LinkChannel`, `ChannelProfile`, `Message`, `ReceivedMessage`, `LinkEvent`. The columns of outcomes
(`LinkEvents`, `OutcomeBlock`, `OutcomeColumns`) may change with a minor version.
"""

from eidrive_scenario.v2x.channel import Channel, LinkChannel
from eidrive_scenario.v2x.link_models.composed import ComposedChannel, ComposedProfile
from eidrive_scenario.v2x.messages.message import LinkEvent, Message, ReceivedMessage, StationState
from eidrive_scenario.v2x.profile import ChannelProfile, build_channel, load_profile
from eidrive_scenario.v2x.propagation import blockage_moments, highway_los
from eidrive_scenario.v2x.radio.channel import RadioChannel
from eidrive_scenario.v2x.radio.packet_error import CURVES
from eidrive_scenario.v2x.radio.profile import RadioProfile
from eidrive_scenario.v2x.radio_environment import LineOfSightStates, RadioEnvironment
from eidrive_scenario.v2x.statistics.link_events import LinkEvents, OutcomeBlock, OutcomeColumns

__all__ = [
    "CURVES",
    "Channel",
    "ChannelProfile",
    "ComposedChannel",
    "ComposedProfile",
    "LineOfSightStates",
    "LinkChannel",
    "LinkEvent",
    "LinkEvents",
    "Message",
    "OutcomeBlock",
    "OutcomeColumns",
    "RadioChannel",
    "RadioEnvironment",
    "RadioProfile",
    "ReceivedMessage",
    "StationState",
    "blockage_moments",
    "build_channel",
    "highway_los",
    "load_profile",
]
