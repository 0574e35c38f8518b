// Units of the screen; everything else is in SI units.

const SETS = [
  { name: "kN · m/min", force: "kN", newton: 1e-3, digits: 1, speed: "m/min", perSecond: 60, decimals: 1 },
  { name: "t · m/min", force: "t", newton: 1 / 9806.65, digits: 2, speed: "m/min", perSecond: 60, decimals: 1 },
  { name: "kN · m/s", force: "kN", newton: 1e-3, digits: 1, speed: "m/s", perSecond: 1, decimals: 2 },
  { name: "t · m/s", force: "t", newton: 1 / 9806.65, digits: 2, speed: "m/s", perSecond: 1, decimals: 2 },
];
let chosen = Number(localStorage.getItem("units")) || 0;

export const units = () => SETS[chosen] ?? SETS[0];
export function nextUnits() {
  chosen = (chosen + 1) % SETS.length;
  localStorage.setItem("units", String(chosen));
}

const MINUS = "−", NONE = "–";
export const known = (value) => typeof value === "number" && Number.isFinite(value);
export function fixed(value, digits, signed = false) {
  if (!known(value)) return NONE;
  const text = Math.abs(value).toFixed(digits);
  const zero = Number(text) === 0;
  return (value < 0 && !zero ? MINUS : signed && !zero ? "+" : "") + text;
}
export const force = (newton, signed = false) =>
  known(newton) ? fixed(newton * units().newton, units().digits, signed) : NONE;
export const speed = (value, signed = false) =>
  known(value) ? fixed(value * units().perSecond, units().decimals, signed) : NONE;
// Words of the twin, which are in m/s and N, in the units of the screen.
export const inUnits = (words) => words.replace(/([+-]?\d[\d.e+-]*) m\/s(?![\w²])/g, (_, one) => `${speed(Number(one))} ${units().speed}`)
  .replace(/([+-]?\d[\d.e+-]*) N(?![\w·])/g, (_, one) => `${force(Number(one))} ${units().force}`);
export const metres = (value, digits = 1, signed = false) => fixed(value, digits, signed);
export function duration(seconds) {
  if (!known(seconds)) return NONE;
  const whole = Math.max(0, Math.floor(seconds));
  const parts = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  return (parts[0] ? `${parts[0]}:` : "") + parts.slice(1).map((one) => String(one).padStart(2, "0")).join(":");
}
