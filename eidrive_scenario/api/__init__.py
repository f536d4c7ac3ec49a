"""Public interface, grouped by audience.

actions     actions, conditions and controller models
criteria    criteria over frames
perception  sensors, detectors, trackers
fusion      fusion methods
v2x         channels
driving     planners, vehicle controllers, driving stacks
run         runs from Python
live        runs in the browser while they are in progress
experiments studies of many runs: jobs, statistics, average precision, the library
pages       drawings, reports and replays
common      names that several groups need: errors, settings, geometry, roads

Extensions import these modules only; the engine itself never does. Each module states which of its names are
stable, and has one line `from … import NAME as NAME` per name that it exports.
"""
