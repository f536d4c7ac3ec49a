"""Channels: the transmission of messages between stations.

Stable: `Channel`, `LinkChannel`, `ChannelProfile`, `Message`, `ReceivedMessage`, `LinkEvent`. The columns of outcomes
(`LinkEvents`, `OutcomeBlock`, `OutcomeColumns`) may change with a minor version.
"""

from eidrive_scenario.v2x.channel import Channel as Channel
from eidrive_scenario.v2x.channel import LinkChannel as LinkChannel
from eidrive_scenario.v2x.link_models.composed import ComposedChannel as ComposedChannel
from eidrive_scenario.v2x.link_models.composed import ComposedProfile as ComposedProfile
from eidrive_scenario.v2x.messages.feature_frames import FeatureFrame as FeatureFrame
from eidrive_scenario.v2x.messages.message import LinkEvent as LinkEvent
from eidrive_scenario.v2x.messages.message import Message as Message
from eidrive_scenario.v2x.messages.message import ReceivedMessage as ReceivedMessage
from eidrive_scenario.v2x.messages.message import StationState as StationState
from eidrive_scenario.v2x.messages.point_cloud import PointCloud as PointCloud
from eidrive_scenario.v2x.profile import ChannelProfile as ChannelProfile
from eidrive_scenario.v2x.profile import build_channel as build_channel
from eidrive_scenario.v2x.profile import load_profile as load_profile
from eidrive_scenario.v2x.propagation import blockage_moments as blockage_moments
from eidrive_scenario.v2x.propagation import highway_los as highway_los
from eidrive_scenario.v2x.radio.channel import RadioChannel as RadioChannel
from eidrive_scenario.v2x.radio.packet_error import CURVES as CURVES
from eidrive_scenario.v2x.radio.profile import RadioProfile as RadioProfile
from eidrive_scenario.v2x.radio_environment import LineOfSightStates as LineOfSightStates
from eidrive_scenario.v2x.radio_environment import RadioEnvironment as RadioEnvironment
from eidrive_scenario.v2x.statistics.link_events import LinkEvents as LinkEvents
from eidrive_scenario.v2x.statistics.link_events import OutcomeBlock as OutcomeBlock
from eidrive_scenario.v2x.statistics.link_events import OutcomeColumns as OutcomeColumns
