"""OpenCL and nothing else: devices, programs, memory. Nothing here runs at import."""

from rift_cl.cl.device import Device
from rift_cl.cl.discovery import default_device, devices, open_device

__all__ = ["Device", "default_device", "devices", "open_device"]
