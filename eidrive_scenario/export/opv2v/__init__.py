"""Datasets in the format of OPV2V: folders of stations with point clouds, pictures, poses and true boxes."""
