"""All maps, in the order of the report."""

from collections.abc import Mapping

from studies.stability_maps import alias, frozen, lagged, overshoot, rigid, schemes, separation, shuttle
from studies.stability_maps.mapping import Map

MAPS: Mapping[str, Map] = {
    module.MAP.name: module.MAP for module in (schemes, lagged, alias, shuttle, frozen, separation, overshoot, rigid)
}
