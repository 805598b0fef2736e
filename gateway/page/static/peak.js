// The angle that decides: the one that the gateway compares with the limits, as the page shows it.

import {highest} from "./alarm.js";
import {isKnown} from "./number.js";

const NORMAL_975 = 1.959964;
export const SOON_S = 0.05; // a peak that comes sooner is the present angle
const MAX_BOUND_DEG = 1; // a larger upper end is no sign of rest
const STAYS_BOUND = 2; // half intervals up to which a number stays an upper bound
const ALIKE_DEG = 0.5; // a number further above the present angle is never shown as that

// Return the next peak as alerts judge it (MotionEstimate.expected_peak): halfway between a pivot or gust that goes on and one
// that ends now, at the time of the larger of both; null where it is not known.
export function comingPeak(motion) {
  const peaks = [
    {angleDeg: motion?.predicted_phi_max_deg, uDeg: motion?.predicted_u_deg, inS: motion?.time_to_peak_s},
    {angleDeg: motion?.coasting_phi_max_deg, uDeg: motion?.coasting_u_deg, inS: motion?.coasting_time_to_peak_s},
  ].filter((peak) => isKnown(peak.angleDeg) && isKnown(peak.inS));
  if (peaks.length < 2) return peaks[0] ?? null;
  const [kept, coasting] = peaks;
  return {
    angleDeg: (kept.angleDeg + coasting.angleDeg) / 2,
    uDeg: Math.hypot((kept.uDeg + coasting.uDeg) / 2, (kept.angleDeg - coasting.angleDeg) / Math.sqrt(12)),
    inS: kept.angleDeg >= coasting.angleDeg ? kept.inS : coasting.inS,
  };
}

// Return the larger of the present angle and the coming peak, with half its 95 % interval and the time until then; null where the
// present angle is not known. A peak that cannot be told from the present angle, and is about as large, is not expected: its time
// is 0, as that of the present angle.
export function deciding(motion) {
  if (!isKnown(motion?.angle_deg) || !isKnown(motion.u_deg)) return null;
  const peak = comingPeak(motion);
  if (peak === null || !isKnown(peak.uDeg) || peak.inS <= SOON_S || peak.angleDeg <= motion.angle_deg) {
    return {angleDeg: motion.angle_deg, halfDeg: NORMAL_975 * motion.u_deg, inS: 0};
  }
  const halfDeg = NORMAL_975 * peak.uDeg;
  const isExpected = peak.angleDeg - motion.angle_deg > Math.min(halfDeg, ALIKE_DEG);
  return {angleDeg: peak.angleDeg, halfDeg, inS: isExpected ? peak.inS : 0};
}

// Return the big number of a verdict, with its title and limits: the lean while a lean alarm decides, else the deciding angle; null
// where it is not known. `halfDeg` is null where no interval can be stated; `isResting`: the load rests, and the angle is no more than
// its lean, so that no peak is expected; `isBound`: it is then no more than its uncertainty, and its upper end says enough; `staysBound`:
// a number that was shown so far as its upper end may be a little more.
export function bigNumber(verdict, {motion, alert}, {warn_deg, trip_deg}) {
  const alarm = highest(alert);
  if (alarm?.rule === "lean") {
    if (!isKnown(alarm.estimate_deg)) return null;
    const limits = {warn_deg: null, trip_deg: alarm.limit_deg};
    return {title: "leaning_angle", limits, angleDeg: alarm.estimate_deg, halfDeg: null, inS: 0, isResting: false, isBound: false, staysBound: false};
  }
  const value = deciding(motion);
  if (value === null) return null;
  const isResting = motion.state === "rest" && Math.abs(value.angleDeg - (motion.lean_deg ?? 0)) <= value.halfDeg;
  const canBeBound = isResting && value.angleDeg + value.halfDeg <= MAX_BOUND_DEG && verdict.sound && alarm === null;
  const isBelow = (share) => canBeBound && value.angleDeg <= share * value.halfDeg;
  const [halfDeg, inS] = [verdict.sound ? value.halfDeg : null, isResting ? 0 : value.inS];
  return {title: "deciding_angle", limits: {warn_deg, trip_deg}, angleDeg: value.angleDeg, halfDeg, inS, isResting, isBound: isBelow(1), staysBound: isBelow(STAYS_BOUND)};
}
