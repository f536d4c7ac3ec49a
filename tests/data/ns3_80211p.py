"""Recipe of ns3_80211p_broadcast_pdr.json and ns3_80211p_load.json: PDR of IEEE 802.11p broadcasts in ns-3.

    pip install ns3==3.44.post0     (1.3 GB, in a separate environment)
    python ns3_80211p.py single [packets per distance]
    python ns3_80211p.py load [seconds]

single  One sender and one receiver. ns-3's default preamble detection drops all that arrives below -82 dBm, which would
        end reception at 150 to 200 m: both its threshold and the sensitivity are lowered.
load    Stations at equal distances on a straight road of 2 km send one message of 350 bytes at a random time of each
        period of 0.1 s. ns-3 senses the channel and detects preambles from -85 dBm on, and a preamble needs a signal
        4 dB above the rest. The number of slots in AIFS is 6, as in the OCB mode (IEEE 802.11-2012, table 8-106).
"""

from __future__ import annotations

import json
import sys

import cppyy
import ns  # noqa: F401  (loads the libraries and headers of ns-3)

CPP = r"""
namespace pdr {
using namespace ns3;

const int CLASSES = 8;
const double WIDTH = 30, PERIOD = 0.1, WARM_UP = 1;
double spacing;
uint32_t stations;
std::vector<uint64_t> sent, received;
Ptr<UniformRandomVariable> uniform;

NetDeviceContainer Install(const std::vector<double>& along, double m, double minimum, double threshold) {
  RngSeedManager::SetSeed(1);
  RngSeedManager::SetRun(1);
  NodeContainer nodes;
  nodes.Create(along.size());
  MobilityHelper mobility;
  auto at = CreateObject<ListPositionAllocator>();
  for (double x : along) at->Add(Vector(x, 0, 1.5));
  mobility.SetPositionAllocator(at);
  mobility.SetMobilityModel("ns3::ConstantPositionMobilityModel");
  mobility.Install(nodes);

  YansWifiChannelHelper channel;
  channel.SetPropagationDelay("ns3::ConstantSpeedPropagationDelayModel");
  channel.AddPropagationLoss("ns3::LogDistancePropagationLossModel", "Exponent", DoubleValue(2.5),
                             "ReferenceDistance", DoubleValue(1.0), "ReferenceLoss", DoubleValue(47.86));
  if (m > 0)
    channel.AddPropagationLoss("ns3::NakagamiPropagationLossModel", "m0", DoubleValue(m), "m1", DoubleValue(m),
                               "m2", DoubleValue(m));
  YansWifiPhyHelper phy;
  phy.SetChannel(channel.Create());
  phy.SetErrorRateModel("ns3::NistErrorRateModel");
  phy.Set("TxPowerStart", DoubleValue(23.0));
  phy.Set("TxPowerEnd", DoubleValue(23.0));
  phy.Set("TxGain", DoubleValue(0.0));
  phy.Set("RxGain", DoubleValue(0.0));
  phy.Set("RxNoiseFigure", DoubleValue(7.0));
  phy.Set("RxSensitivity", DoubleValue(-110.0));
  phy.Set("ChannelSettings", StringValue("{0, 10, BAND_5GHZ, 0}"));
  phy.SetPreambleDetectionModel("ns3::ThresholdPreambleDetectionModel", "MinimumRssi", DoubleValue(minimum),
                                "Threshold", DoubleValue(threshold));
  WifiHelper wifi;
  wifi.SetStandard(WIFI_STANDARD_80211p);
  StringValue mode("OfdmRate6MbpsBW10MHz");
  wifi.SetRemoteStationManager("ns3::ConstantRateWifiManager", "DataMode", mode, "ControlMode", mode,
                               "NonUnicastMode", mode);
  WifiMacHelper mac;
  mac.SetType("ns3::AdhocWifiMac", "QosSupported", BooleanValue(false));
  NetDeviceContainer devices = wifi.Install(phy, mac, nodes);
  wifi.AssignStreams(devices, 100);
  return devices;
}

void Simulate(double seconds) {
  Simulator::Stop(Seconds(seconds));
  Simulator::Run();
  Simulator::Destroy();
}

uint32_t taken = 0;

bool TakeAny(Ptr<NetDevice>, Ptr<const Packet>, uint16_t, const Address&) {
  ++taken;
  return true;
}

void SendAny(Ptr<NetDevice> device, uint32_t size) {
  device->Send(Create<Packet>(size), Mac48Address::GetBroadcast(), 0x0800);
}

double Single(double distance, double m, uint32_t packets, uint32_t size) {
  taken = 0;
  auto devices = Install({0, distance}, m, -110, -10);
  devices.Get(1)->SetReceiveCallback(MakeCallback(&TakeAny));
  for (uint32_t k = 0; k < packets; ++k)
    Simulator::Schedule(Seconds(0.1 + 0.002 * k), &SendAny, devices.Get(0), size);
  Simulate(0.2 + 0.002 * packets);
  return double(taken) / packets;
}

void Count(std::vector<uint64_t>& counts, uint32_t one, uint32_t other) {
  int k = int(spacing * std::abs(double(one) - double(other)) / WIDTH);
  if (k < CLASSES && one != other) counts[k]++;
}

bool Take(Ptr<NetDevice> device, Ptr<const Packet> packet, uint16_t, const Address&) {
  uint8_t head[3];
  packet->CopyData(head, 3);
  if (head[2]) Count(received, device->GetNode()->GetId(), head[0] + 256u * head[1]);
  return true;
}

void Send(Ptr<NetDevice> device, uint32_t size) {
  uint32_t id = device->GetNode()->GetId();
  bool counted = Simulator::Now().GetSeconds() > WARM_UP;
  std::vector<uint8_t> data(size, 0);
  data[0] = id % 256, data[1] = id / 256, data[2] = counted;
  device->Send(Create<Packet>(data.data(), size), Mac48Address::GetBroadcast(), 0x0800);
  if (counted)
    for (uint32_t other = 0; other < stations; ++other) Count(sent, id, other);
}

void Period(Ptr<NetDevice> device, uint32_t size) {
  Simulator::Schedule(Seconds(uniform->GetValue(0, PERIOD)), &Send, device, size);
  Simulator::Schedule(Seconds(PERIOD), &Period, device, size);
}

std::vector<double> Load(double per_km, double length, uint32_t size, double seconds) {
  spacing = 1000 / per_km, stations = uint32_t(per_km * length / 1000);
  sent.assign(CLASSES, 0), received.assign(CLASSES, 0);
  std::vector<double> along;
  for (uint32_t k = 0; k < stations; ++k) along.push_back(spacing * k);
  auto devices = Install(along, 0, -85, 4);
  uniform = CreateObject<UniformRandomVariable>();
  for (uint32_t k = 0; k < stations; ++k) {
    devices.Get(k)->SetReceiveCallback(MakeCallback(&Take));
    DynamicCast<WifiNetDevice>(devices.Get(k))->GetMac()->GetTxop()->SetAifsn(6);
    Simulator::Schedule(Seconds(0), &Period, devices.Get(k), size);
  }
  Simulate(seconds);
  std::vector<double> ratios;
  for (int k = 0; k < CLASSES; ++k) ratios.push_back(double(received[k]) / sent[k]);
  return ratios;
}
}
"""
CASES = {
    "none": (0.0, [300, 350, 375, 390, 400, 410, 420, 425, 430, 440, 450, 460, 475, 500]),
    "nakagami_1": (1.0, [50, 100, 150, 200, 250, 300, 350, 400, 450, 500, 550, 600, 650, 700]),
    "nakagami_3": (3.0, [100, 150, 200, 250, 300, 350, 400, 450, 500, 550, 600, 650, 700]),
}
"""Fading: its shape m (0: none), and distances [m]."""


def main() -> None:
    """Print the table as JSON."""
    part, *amount = sys.argv[1:]
    cppyy.cppdef(CPP)
    pdr = cppyy.gbl.pdr
    table: dict[str, object] = {}
    if part == "single":
        packets = int(amount[0]) if amount else 20000
        for name, (m, distances) in CASES.items():
            ratios = [pdr.Single(float(distance), m, packets, 300) for distance in distances]
            table[name] = {"distance_m": distances, "pdr": ratios}
    else:
        seconds = float(amount[0]) if amount else 6.0
        table = {"bytes_on_air": 386, "class_m": 30, "length_m": 2000}
        for per_km in (50, 100, 200):
            table[str(per_km)] = [round(ratio, 4) for ratio in pdr.Load(float(per_km), 2000.0, 350, seconds)]
    json.dump(table, sys.stdout, indent=1)


if __name__ == "__main__":
    main()
