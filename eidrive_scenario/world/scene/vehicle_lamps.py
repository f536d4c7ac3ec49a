"""Lamps of vehicles: state, brightness and beams."""

from __future__ import annotations

from collections.abc import Mapping

from eidrive_scenario.world.actor import ActorSpec
from eidrive_scenario.world.appearance import Appearance, LightState
from eidrive_scenario.world.render.model import Light, linear
from eidrive_scenario.world.weather import Weather

HEADLIGHT: Light = (6_500.0, 6_000.0, 4_900.0)
TAILLIGHT: Light = (300.0, 0.8, 0.5)
"""Luminance of lamps at night [cd/m²]."""

_HIGH: Light = (26_000.0, 24_000.0, 20_000.0)
_DAY: Light = (9_000.0, 9_200.0, 9_600.0)
_BRAKE: Light = (7_500.0, 12.0, 8.0)
_REAR_FOG: Light = (9_000.0, 14.0, 9.0)
_INDICATOR: Light = (11_000.0, 3_600.0, 30.0)
_WHITE: Light = (7_000.0, 6_800.0, 6_200.0)
_PLATE: Light = (28.0, 26.0, 22.0)
_BEACON: Light = (150.0, 700.0, 11_000.0)
"""Luminous intensities within the bounds of UN Regulations 7, 6, 38, 23, 87 and 65, divided by the areas of the lamps.
"""

_SHINES: Mapping[str, tuple[tuple[str, Light], ...]] = {
    "daytimeRunningLights": (("headlight", _DAY),),
    "lowBeam": (("headlight", HEADLIGHT), ("taillight", TAILLIGHT)),
    "highBeam": (("headlight", _HIGH), ("taillight", TAILLIGHT)),
    "fogLights": (("headlight", HEADLIGHT), ("taillight", _REAR_FOG)),
    "fogLightsFront": (("headlight", HEADLIGHT),),
    "fogLightsRear": (("taillight", _REAR_FOG),),
    "brakeLights": (("taillight", _BRAKE),),
    "warningLights": (("indicator_left", _INDICATOR), ("indicator_right", _INDICATOR)),
    "indicatorLeft": (("indicator_left", _INDICATOR),),
    "indicatorRight": (("indicator_right", _INDICATOR),),
    "reversingLights": (("reversing_light", _WHITE),),
    "licensePlateIllumination": (("plate", _PLATE),),
    "specialPurposeLights": (("blue_light", _BEACON),),
}
"""Light types of the standard, and the materials of the meshes that emit light."""
_BEAMS = ("lowBeam", "highBeam", "fogLights", "fogLightsFront")


def glow(spec: ActorSpec, appearance: Appearance, weather: Weather, time: float) -> Mapping[str, Light]:
    """Return the luminance of the materials of an actor at `time` [s], linear red, green, blue [cd/m²].

    Lamps without a LightStateAction follow the weather: low beam and tail lamps are on in the dark and in thick air.
    """
    found: dict[str, Light] = {}
    for name, light in _lights(spec, appearance, weather).items():
        brightness = light.brightness(time)
        for material, luminance in _SHINES.get(name, ()) if brightness > 0.0 else ():
            shown = _colored(luminance, light, brightness)
            found[material] = _brighter(found.get(material), shown)
    return found


def beam(spec: ActorSpec, appearance: Appearance, weather: Weather, time: float) -> tuple[float, bool] | None:
    """Return the brightness of the headlamps in [0, 1], and whether they are on high beam; None if they are off."""
    lights = _lights(spec, appearance, weather)
    found = {name: lights[name].brightness(time) for name in _BEAMS if name in lights}
    brightest = max(found.values(), default=0.0)
    return (brightest, found.get("highBeam", 0.0) > 0.0) if brightest > 0.0 else None


def _lights(spec: ActorSpec, appearance: Appearance, weather: Weather) -> Mapping[str, LightState]:
    """Return the switched lights, and an automatic low beam if it was not switched."""
    lights = appearance.lights
    if weather.lamps_on and "lowBeam" not in lights and spec.wheelbase > 0.0 and spec.shape != "bicycle":
        return {"lowBeam": LightState("lowBeam", "on"), **lights}
    return lights


def _colored(luminance: Light, light: LightState, brightness: float) -> Light:
    """Return the luminance in the color of the light, if it has one, at the same brightness."""
    if light.color is not None:
        red, green, blue = linear(light.color)
        most = max(red, green, blue)
        scale = max(luminance) / most if most > 0.0 else 0.0
        luminance = (red * scale, green * scale, blue * scale)
    return luminance[0] * brightness, luminance[1] * brightness, luminance[2] * brightness


def _brighter(one: Light | None, other: Light) -> Light:
    return other if one is None or max(other) >= max(one) else one
