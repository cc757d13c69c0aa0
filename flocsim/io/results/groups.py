"""Arrays along named axes as groups of an HDF5 file, as xarray and people read them."""

from typing import Any

from flocsim.io.labelled import Labelled


def write_labelled(group: Any, labelled: Labelled) -> None:
    """Write arrays into an open group, their axes as dimension scales.

    A coordinate that is no axis itself is an array that the group's attribute names.
    """
    import h5py

    inner = {name: each for name, each in labelled.axes.items() if each.axes != (name,)}
    for name, axis in labelled.axes.items():
        if name in inner:
            continue
        words = axis.values.dtype.kind in "OU"
        kind = h5py.string_dtype() if words else None
        values = axis.values.tolist() if words else axis.values
        scale = group.create_dataset(name, data=values, dtype=kind)
        scale.make_scale(name)
        scale.attrs.update(axis.about)
    if inner:
        group.attrs["coordinates"] = " ".join(inner)
    for name, column in (inner | labelled.columns).items():
        dataset = group.create_dataset(name, data=column.values)
        dataset.attrs.update(column.about)
        for number, axis_name in enumerate(column.axes):
            dataset.dims[number].attach_scale(group[axis_name])
