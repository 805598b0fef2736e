"""The end of a trial of the configuration: the gateway is healthy for a while, or not in time."""

import logging
import threading

from gateway.daemon.configuration_service import ConfigurationService
from gateway.daemon.health import HealthReporter

log = logging.getLogger("plumbline.configuration")
HEALTHY_S = 10.0
"""Uninterrupted health that confirms a configuration."""
DEADLINE_S = 60.0
"""Time after the start in which a configuration must become healthy."""


class TrialSupervisor:
    """Confirms a configuration on trial or rolls it back, and ends the gateway for another one; time is an argument."""

    def __init__(
        self, changes: ConfigurationService, health: HealthReporter, stopping: threading.Event, now_s: float
    ) -> None:
        self._changes = changes
        self._health = health
        self._stopping = stopping
        self._started_s = now_s
        self._healthy_since_s: float | None = None
        self._active = changes.on_trial

    def tick(self, now_s: float) -> None:
        """Judge the gateway; call a few times a second."""
        if self._active:
            try:
                self._judge(now_s, self._health.find_problem(now_s))
            except OSError as error:
                log.error("the trial of the configuration cannot be ended: %s", error)
        if self._changes.restart_wanted:
            self._stopping.set()

    def _judge(self, now_s: float, problem: str | None) -> None:
        if problem is not None:
            self._healthy_since_s = None
            if now_s - self._started_s >= DEADLINE_S:
                self._changes.roll_back(problem)
                self._active = False
            return
        if self._healthy_since_s is None:
            self._healthy_since_s = now_s
        if now_s - self._healthy_since_s >= HEALTHY_S:
            self._changes.confirm()
            self._active = False
