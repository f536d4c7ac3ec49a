"""Recipe of ns3_80211p_broadcast_pdr.json: PDR over distance of IEEE 802.11p broadcasts in ns-3.

    pip install ns3==3.44.post0     (1.3 GB, in a separate environment)
    python ns3_80211p_broadcast_pdr.py [packets per distance]

One sender and one receiver; no other station transmits. ns-3's default preamble detection drops all that arrives below
-82 dBm, which would end reception at 150 to 200 m: both its threshold and the sensitivity are lowered.
"""

from __future__ import annotations

import json
import sys

import cppyy
import ns  # noqa: F401  (loads the libraries and headers of ns-3)

CPP = r"""
namespace pdr {
using namespace ns3;

uint32_t received = 0;

bool Take(Ptr<NetDevice>, Ptr<const Packet>, uint16_t, const Address&) {
  ++received;
  return true;
}

void Send(Ptr<NetDevice> device, uint32_t size) {
  device->Send(Create<Packet>(size), Mac48Address::GetBroadcast(), 0x0800);
}

double Run(double distance, double m, uint32_t packets, uint32_t size) {
  RngSeedManager::SetSeed(1);
  RngSeedManager::SetRun(1);
  received = 0;
  NodeContainer nodes;
  nodes.Create(2);
  MobilityHelper mobility;
  auto at = CreateObject<ListPositionAllocator>();
  at->Add(Vector(0, 0, 1.5));
  at->Add(Vector(distance, 0, 1.5));
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
  phy.SetPreambleDetectionModel("ns3::ThresholdPreambleDetectionModel", "MinimumRssi", DoubleValue(-110.0),
                                "Threshold", DoubleValue(-10.0));
  WifiHelper wifi;
  wifi.SetStandard(WIFI_STANDARD_80211p);
  StringValue mode("OfdmRate6MbpsBW10MHz");
  wifi.SetRemoteStationManager("ns3::ConstantRateWifiManager", "DataMode", mode, "ControlMode", mode,
                               "NonUnicastMode", mode);
  WifiMacHelper mac;
  mac.SetType("ns3::AdhocWifiMac", "QosSupported", BooleanValue(false));
  NetDeviceContainer devices = wifi.Install(phy, mac, nodes);
  wifi.AssignStreams(devices, 100);
  devices.Get(1)->SetReceiveCallback(MakeCallback(&Take));
  for (uint32_t k = 0; k < packets; ++k)
    Simulator::Schedule(Seconds(0.1 + 0.002 * k), &Send, devices.Get(0), size);
  Simulator::Stop(Seconds(0.2 + 0.002 * packets));
  Simulator::Run();
  Simulator::Destroy();
  return double(received) / packets;
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
    packets = int(sys.argv[1]) if len(sys.argv) > 1 else 20000
    cppyy.cppdef(CPP)
    run = cppyy.gbl.pdr.Run
    table = {
        name: {"distance_m": distances, "pdr": [run(float(distance), m, packets, 300) for distance in distances]}
        for name, (m, distances) in CASES.items()
    }
    json.dump(table, sys.stdout, indent=1)


if __name__ == "__main__":
    main()
