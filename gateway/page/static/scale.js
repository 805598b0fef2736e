// Where an angle stands on the gauge and on the trend, as a share of their length: evenly up to the limit, and closer and closer
// beyond it. So the limits keep their places, and 8° does not look like 5° where both are beyond.

const LIMIT_AT = 2 / 3;

export function scaleShare(angleDeg, limitDeg) {
  const ratio = Math.max(angleDeg, 0) / limitDeg;
  return ratio <= 1 ? LIMIT_AT * ratio : 1 - (1 - LIMIT_AT) / ratio;
}
