"""Poses of heads that are turned far: points are followed and solved together with the poses."""
