"""All tables together, for migrations."""

from __future__ import annotations

from service.store import access, assets, results, work
from service.store.base import Base

TABLE_MODULES = (access, assets, results, work)
METADATA = Base.metadata
# tables whose rows are history: the database refuses to change or delete them
APPEND_ONLY = ("audit_log", "calibration_events", "calibrations", "estimates", "nights", "robot_models")
