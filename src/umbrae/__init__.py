"""Exact shadows of arbitrary triangle soups."""

from umbrae.animation import Animation
from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.errors import (
    CapacityError,
    GraphicsError,
    InputError,
    ModelError,
    OptionError,
    OutputError,
    RecentredWarning,
    UmbraeError,
)
from umbrae.files import load, load_animation, save
from umbrae.image import Image
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.material import Material
from umbrae.methods import METHODS, Caster, Method, shadow
from umbrae.render import render
from umbrae.samples import ViewSamples
from umbrae.sampling import sample, sample_layers, sample_stochastic, sample_tessellated
from umbrae.scene import Scene
from umbrae.sun import SunStudy, sun_hours
from umbrae.verify import Verdict, verify

__version__ = "0.1.0"

__all__ = [
    "METHODS",
    "Animation",
    "Camera",
    "CapacityError",
    "Caster",
    "Clock",
    "GraphicsError",
    "Guarantee",
    "Image",
    "InputError",
    "Light",
    "Material",
    "Method",
    "ModelError",
    "OptionError",
    "OutputError",
    "RecentredWarning",
    "Scene",
    "ShadowMask",
    "SunStudy",
    "UmbraeError",
    "Verdict",
    "ViewSamples",
    "load",
    "load_animation",
    "render",
    "sample",
    "sample_layers",
    "sample_stochastic",
    "sample_tessellated",
    "save",
    "shadow",
    "sun_hours",
    "verify",
]
