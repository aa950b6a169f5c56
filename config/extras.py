"""Which extra of the package brings what is not installed, said in one line."""

from importlib import import_module
from typing import Any

EXTRAS = {
    "numba": "sim,plot",
    "llvmlite": "sim,plot",
    "scipy": "sim,plot",
    "matplotlib": "sim,plot",
    "pandas": "frame",
    "pyarrow": "parquet",
    "openpyxl": "xlsx",
    "h5py": "hdf5",
    "nptdms": "tdms",
    "asammdf": "mdf",
    "plotly": "report",
    "canopen": "canopen",
    "can": "canopen",
    "cryptography": "tls",
    "shtab": "completion",
    "prometheus_client": "metrics",
    "asyncua": "opcua",
    "nicegui": "web",
    "fastapi": "web",
    "uvicorn": "web",
    "distributed": "fleet",
    "dask": "fleet",
}
"""The extra, by the name of the module that is missing."""


def name_missing_extra(who: str, error: ModuleNotFoundError) -> str:
    """Return the line for a module that is missing: who needs it, and what to install; empty if no extra brings it."""
    missing = (error.name or "").partition(".")[0]
    if missing not in EXTRAS:
        return ""
    return f"{who} needs {missing}, which is not installed: pip install 'positioner[{EXTRAS[missing]}]'"


def import_extra(module: str, who: str) -> Any:
    """Import a module that an extra brings.

    Raises:
        ModuleNotFoundError: it is not installed; names who needs it and the extra.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(name_missing_extra(who, error) or str(error), name=error.name) from None
