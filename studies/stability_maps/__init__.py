"""The maps of the kind "stability", one file each, listed in `studies.stability_maps.table`."""
