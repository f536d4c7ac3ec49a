"""Recipe of ns3_80211p_load.json: PDR over distance of IEEE 802.11p broadcasts by many stations in ns-3.

    pip install ns3==3.44.post0     (1.3 GB, in a separate environment)
    python ns3_80211p_load.py [seconds]

Stations at equal distances on a straight road of 2 km send one message of 350 bytes at a random time of each period of
0.1 s. ns-3 senses the channel and detects preambles from -85 dBm on, and a preamble needs a signal 4 dB above the rest.
The number of slots in AIFS is 6, as in the OCB mode (IEEE 802.11-2012, table 8-106); the default of ns-3 is 2.
"""

from __future__ import annotations

import json
import sys

import cppyy
import ns  # noqa: F401  (loads the libraries and headers of ns-3)

CPP = r"""
namespace load {
using namespace ns3;

const int CLASSES = 8;
const double WIDTH = 30, PERIOD = 0.1, WARM_UP = 1;
double spacing;
uint32_t stations;
std::vector<uint64_t> sent, received;
Ptr<UniformRandomVariable> uniform;

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

void Run(double per_km, double length, uint32_t size, double seconds) {
  RngSeedManager::SetSeed(1);
  RngSeedManager::SetRun(1);
  spacing = 1000 / per_km, stations = uint32_t(per_km * length / 1000);
  sent.assign(CLASSES, 0), received.assign(CLASSES, 0);
  uniform = CreateObject<UniformRandomVariable>();
  NodeContainer nodes;
  nodes.Create(stations);
  MobilityHelper mobility;
  auto at = CreateObject<ListPositionAllocator>();
  for (uint32_t k = 0; k < stations; ++k) at->Add(Vector(spacing * k, 0, 1.5));
  mobility.SetPositionAllocator(at);
  mobility.SetMobilityModel("ns3::ConstantPositionMobilityModel");
  mobility.Install(nodes);

  YansWifiChannelHelper channel;
  channel.SetPropagationDelay("ns3::ConstantSpeedPropagationDelayModel");
  channel.AddPropagationLoss("ns3::LogDistancePropagationLossModel", "Exponent", DoubleValue(2.5),
                             "ReferenceDistance", DoubleValue(1.0), "ReferenceLoss", DoubleValue(47.86));
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
  phy.SetPreambleDetectionModel("ns3::ThresholdPreambleDetectionModel", "MinimumRssi", DoubleValue(-85.0),
                                "Threshold", DoubleValue(4.0));
  WifiHelper wifi;
  wifi.SetStandard(WIFI_STANDARD_80211p);
  StringValue mode("OfdmRate6MbpsBW10MHz");
  wifi.SetRemoteStationManager("ns3::ConstantRateWifiManager", "DataMode", mode, "ControlMode", mode,
                               "NonUnicastMode", mode);
  WifiMacHelper mac;
  mac.SetType("ns3::AdhocWifiMac", "QosSupported", BooleanValue(false));
  NetDeviceContainer devices = wifi.Install(phy, mac, nodes);
  wifi.AssignStreams(devices, 100);
  for (uint32_t k = 0; k < stations; ++k) {
    devices.Get(k)->SetReceiveCallback(MakeCallback(&Take));
    DynamicCast<WifiNetDevice>(devices.Get(k))->GetMac()->GetTxop()->SetAifsn(6);
    Simulator::Schedule(Seconds(0), &Period, devices.Get(k), size);
  }
  Simulator::Stop(Seconds(seconds));
  Simulator::Run();
  Simulator::Destroy();
}
}
"""


def main() -> None:
    """Print the table as JSON."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 10.0
    cppyy.cppdef(CPP)
    load = cppyy.gbl.load
    table: dict[str, int | list[float]] = {"bytes_on_air": 386, "class_m": 30, "length_m": 2000}
    for per_km in (50, 100, 200):
        load.Run(float(per_km), 2000.0, 350, seconds)
        table[str(per_km)] = [round(load.received[k] / load.sent[k], 4) for k in range(8)]
    json.dump(table, sys.stdout, indent=1)


if __name__ == "__main__":
    main()
