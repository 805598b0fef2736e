"""What a gateway says, as messages of the real classes: a test changes an attribute, and the next messages say that."""

from typing import Any

from gateway.messages import (
    NO_SESSION,
    ActiveAlert,
    Alert,
    Calibration,
    CalibrationOffer,
    CalibrationStatus,
    Condition,
    Formulas,
    Health,
    Level,
    Message,
    Motion,
    MotionProbabilities,
    MotionState,
    Swing,
    Tilt,
    Validity,
    Verdict,
)
from gateway.stages.condition import CAUSES

SAMPLE_TIME_NS = 1_760_000_000_000_000_000


class Scene:
    """What the gateway says; a test changes an attribute and the next messages say that."""

    def __init__(self) -> None:
        self.phi_max_deg: float | None = 2.3
        self.swinging: bool | None = True
        self.phi_max_u_deg = 0.1
        self.coverage95_deg: list[float] | None = [2.1, 2.5]
        self.state: MotionState = "free"
        self.hoist_m_s = 0.0
        self.motion_codes: list[str] = []
        self.azimuth_deg: float | None = 35.0
        self.lean_deg = 0.8
        self.level: Level = "normal"
        self.alert_text = "all normal"
        self.condition: Verdict = "swinging"
        self.trusted = True
        self.reasons: list[str] = []
        self.codes: list[str] = []
        self.calibration: CalibrationStatus = "calibrated"
        self.recording_error: str | None = None
        self.device_kind = "adxl355"
        self.session = NO_SESSION
        self.pitch_deg, self.roll_deg = 0.5, 0.6
        self.drift: dict[str, Any] | None = None
        self.offer: CalibrationOffer | None = None
        self.standing_faults: dict[str, str] = {}
        self.battery_low: bool | None = None
        self.changed_limits: list[str] | None = []
        self.incident: str | None = "b00t-1"
        self.acknowledged_by: str | None = None
        """Who acknowledged the incident, also after its end."""
        self.boot_id: str | None = None
        self.time_to_peak_s = 1.7
        self.expected_deg: float | None = None
        """The coming peak; None: phi_max_deg."""
        self.angle_share = 0.5
        """Of the present angle in the coming peak."""
        self.validity: Validity = "valid"
        self.rule = "swing"
        self.largest_deg = 6.3
        self.ends_in_s: float | None = None
        self.expected_in_s = 0.0
        """Time until the angle that was compared."""

    def messages(self, sequence: int, time_ns: int) -> list[Message]:
        """One of each topic that the page reads, without readings those alone that do not depend on them."""
        measured = [
            self.tilt(sequence, time_ns),
            self.motion(sequence, time_ns),
            self.swing(sequence, time_ns),
            self.judged(sequence, time_ns),
        ]
        return [
            *([] if self.validity == "no_samples" else measured),
            self.alert(sequence, time_ns),
            self.calibrated(sequence, time_ns),
            self.health(sequence, time_ns),
        ]

    def _header(self, sequence: int, time_ns: int) -> dict[str, Any]:
        return {"time_ns": time_ns, "clock": "synchronised", "sequence": sequence, "calibration_id": "six-2025-03"}

    def tilt(self, sequence: int = 0, time_ns: int = SAMPLE_TIME_NS) -> Tilt:
        return Tilt(
            **self._header(sequence, time_ns),
            pitch_deg=self.pitch_deg,
            roll_deg=self.roll_deg,
            axial_deg=0.8 + 0.3 * (sequence % 7) / 7,
            u_deg=0.02,
            direction_deg=110.0 + 20 * (sequence % 11) / 11,
            specific_force_g=[0.01, 0.01, 1.0],
            temperature_c=21.5,
            delay_s=0.23,
            trusted=self.condition in ("static", "quasi_static"),
        )

    def motion(self, sequence: int = 0, time_ns: int = SAMPLE_TIME_NS) -> Motion:
        low_deg, high_deg = self.coverage95_deg or (None, None)
        known = high_deg is not None and low_deg is not None
        peak_deg = self.phi_max_deg if self.expected_deg is None else self.expected_deg
        return Motion(
            **self._header(sequence, time_ns),
            state=self.state if known else "unknown",
            angle_deg=self.angle_share * (peak_deg or 0.0) if known else None,
            u_deg=0.1 if known else None,
            azimuth_deg=self.azimuth_deg,
            rate_deg_s=0.5,
            pivot_accel_m_s2=[0.0, 0.0],
            pivot_accel_u_m_s2=0.01,
            hoist_m_s=self.hoist_m_s,
            hoist_u_m_s=0.01,
            length_m=12.0,
            length_u_m=0.1,
            phi_max_deg=self.phi_max_deg if known else None,
            phi_max_u_deg=self.phi_max_u_deg if known else None,
            predicted_phi_max_deg=peak_deg,
            predicted_u_deg=self.phi_max_u_deg,
            time_to_peak_s=self.time_to_peak_s,
            coasting_phi_max_deg=peak_deg,
            coasting_u_deg=self.phi_max_u_deg,
            coasting_time_to_peak_s=self.time_to_peak_s,
            lean_deg=self.lean_deg,
            lean_u_deg=0.05,
            probabilities=self._probabilities(),
            fast_oscillation_hz=None,
            fast_oscillation_deg=None,
            reasons=self.motion_codes,
            reason_codes=self.motion_codes or None,
            text="Free swing 2.3° ± 0.2°." if known else "Swing not known: too short a stretch.",
        )

    def _probabilities(self) -> MotionProbabilities:
        """Those of a state that is certain."""
        acts = {"driven": 0.0, "wind": 0.0, "hoisting": 0.0} | ({self.state: 1.0} if self.state in CAUSES else {})
        return MotionProbabilities(free=1 - acts["driven"] - acts["wind"], **acts)

    def swing(self, sequence: int = 0, time_ns: int = SAMPLE_TIME_NS) -> Swing:
        return Swing(
            **self._header(sequence, time_ns),
            swinging=self.swinging,
            phi_max_deg=self.phi_max_deg,
            u_deg=0.1,
            coverage95_deg=self.coverage95_deg,
            minor_phi_max_deg=0.25 * (self.phi_max_deg or 0),
            azimuth_deg=self.azimuth_deg,
            lean_deg=self.lean_deg,
            lean_azimuth_deg=110.0,
            period_s=6.9,
            predicted_phi_max_deg=self.phi_max_deg,
            predicted_u_deg=0.15,
            time_to_peak_s=1.7,
            formulas_deg=Formulas(arccos_min_az=2.4, arcsin_max_axy=1.1, arctan_max_axy_min_az=1.1, arccos_max_az=1.8),
            reasons=[] if self.swinging is not None else ["too short a stretch"],
        )

    def judged(self, sequence: int = 0, time_ns: int = SAMPLE_TIME_NS) -> Condition:
        return Condition(
            **self._header(sequence, time_ns),
            verdict=self.condition,
            cause=None,
            trusted=self.trusted,
            reasons=self.reasons,
            reason_codes=self.codes or None,
            gates={"still": False, "not_clipped": True, "norm_hanging": self.trusted},
            norm_g=1.0003,
            permissible_norm_error_g=0.004,
            calibration=self.calibration,
        )

    def alert(self, sequence: int = 0, time_ns: int = SAMPLE_TIME_NS) -> Alert:
        steps_down = self.rule == "swing" and self.level == "trip"
        standing = ActiveAlert(
            rule=self.rule,
            level=self.level,
            since_ns=SAMPLE_TIME_NS,
            value_deg=6.4,
            limit_deg=4.0 if self.level == "warn" else 6.0,
            clear_deg=3.0,
            ends_in_s=self.ends_in_s,
            next_level="warn" if steps_down else "normal",
            next_below_deg=5.4 if steps_down else 3.0,
            expected_in_s=self.expected_in_s,
            estimate_deg=6.2,
            largest_deg=self.largest_deg,
            incident=self.incident,
            acknowledged_by=self.acknowledged_by,
            acknowledged_ns=None if self.acknowledged_by is None else SAMPLE_TIME_NS,
            text=self.alert_text,
        )
        is_late = self.level == "normal" and self.acknowledged_by is not None
        return Alert(
            **self._header(sequence, time_ns),
            level=self.level,
            validity=self.validity,
            event="acknowledged" if is_late else "standing",
            rule=self.rule if is_late else None,
            active=[] if self.level == "normal" else [standing],
            incident=self.incident if is_late else None,
            acknowledged_by=self.acknowledged_by if is_late else None,
            text=self.alert_text,
            boot_id=self.boot_id,
        )

    def calibrated(self, sequence: int = 0, time_ns: int = SAMPLE_TIME_NS) -> Calibration:
        return Calibration(
            **self._header(sequence, time_ns),
            status=self.calibration,
            device_id="adxl355-0042",
            record={"id": "six-2025-03", "offset": [0.0] * 300},
            in_force={},
            text="six-position, 2025-03-14" if self.calibration == "calibrated" else "no record for adxl355-0042",
            session=self.session,
        )

    def health(self, sequence: int = 0, time_ns: int = SAMPLE_TIME_NS) -> Health:
        return Health(
            **self._header(sequence, time_ns),
            state="running",
            device_id="adxl355-0042",
            device_kind=self.device_kind,
            boot_id="b00t",
            software="0.1.0",
            uptime_s=3600.0,
            measured_rate_hz=125.04,
            samples=450123 + sequence,
            lost=12,
            invalid=0,
            faults={"overrun": 2},
            dropped={"bus": 0},
            recording="/data/2025-03-14T10-00-00.mcap",
            recording_error=self.recording_error,
            disk_free_mb=51234.0,
            cpu_percent=3.0,
            resident_mb=51.0,
            drift=self.drift,
            offer=self.offer,
            standing_faults=self.standing_faults,
            battery_low=self.battery_low,
            changed_limits=self.changed_limits,
        )
