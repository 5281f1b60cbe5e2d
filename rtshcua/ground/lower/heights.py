"""Floors and ceilings of zones in mm above home."""

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.report import Report
from rtshcua.model.flat.zone import HIGHEST, LOWEST
from rtshcua.model.ir.expression import Quantity
from rtshcua.model.ir.places import VehicleDecl, ZoneDecl
from rtshcua.model.quantity import Datum, Dimension, display


class Heights:
    """Converts altitudes above sea by the elevation of a vehicle's home."""

    def __init__(self, vehicle: VehicleDecl | None, report: Report) -> None:
        self._vehicle = vehicle
        self._report = report

    def band(self, zone: ZoneDecl) -> tuple[int, int, int, int]:
        """Floor and ceiling, and how far either may really be from there."""
        floor, floor_within = (LOWEST, 0) if zone.floor is None else self._above_home(zone.floor, zone)
        ceiling, ceiling_within = (HIGHEST, 0) if zone.ceiling is None else self._above_home(zone.ceiling, zone)
        if zone.floor is not None and zone.ceiling is not None and zone.floor.datum is not zone.ceiling.datum:
            self._crossed(zone, zone.ceiling, ceiling - floor)
        if floor < ceiling and floor + floor_within >= ceiling - ceiling_within:
            self._unsure(zone, ceiling - floor)
        return floor, ceiling, floor_within, ceiling_within

    def _above_home(self, height: Quantity, zone: ZoneDecl) -> tuple[int, int]:
        if height.datum is not Datum.SEA:
            return height.value, 0
        vehicle = self._vehicle
        if vehicle is None or vehicle.elevation is None:
            self._report.add(
                codes.NO_ELEVATION,
                height.span,
                f"`{zone.name.text}` reaches to an altitude above sea, and how high home is above sea is not known",
                help="say so in the vehicle, as in `elevation 408 m above sea within 5 m`",
                labels=[] if vehicle is None else [(vehicle.name.span, "the vehicle")],
            )
            return height.value, 0
        within = 0 if vehicle.elevation_within is None else vehicle.elevation_within.value
        return min(max(height.value - vehicle.elevation.value, LOWEST), HIGHEST), within

    def _crossed(self, zone: ZoneDecl, ceiling: Quantity, height: int) -> None:
        """A floor and a ceiling of different datum compare only here."""
        assert zone.floor is not None
        if height <= 0:
            self._report.add(
                codes.FLOOR_ABOVE_CEILING,
                ceiling.span,
                f"the ceiling of `{zone.name.text}` is not above its floor",
                labels=[(zone.floor.span, f"the floor is {display(-height, Dimension.LENGTH)} higher, or as high")],
            )

    def _unsure(self, zone: ZoneDecl, height: int) -> None:
        assert self._vehicle is not None
        assert self._vehicle.elevation_within is not None
        self._report.add(
            codes.EMPTY_ZONE,
            zone.name.span,
            f"of `{zone.name.text}`, which is {display(height, Dimension.LENGTH)} high, there is no height at which "
            "a vehicle would surely be inside",
            help="make the band higher than twice the error of the elevation, or measure the elevation better",
            labels=[(self._vehicle.elevation_within.span, "how far the real elevation may differ")],
        )
