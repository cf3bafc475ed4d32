"""Brings a graph of stages up to date: in one process, in several, or on other machines.

It knows nothing of what the stages do, and imports nothing outside of this folder but packages
from elsewhere: pydantic, and for `cluster` Dask's `distributed`. To use it in another project, copy
the folder, derive classes from `graph.stage.Stage` in a module that other processes can import,
and collect them in jobs (`graph.graph.Job`).
"""
