// Colours for values, and their legend: viridis for what is everywhere, heat for what is at some places.

const RED = [0.2777, 0.1051, -0.3309, -4.6342, 6.2283, 4.7764, -5.4355];
const GREEN = [0.0054, 1.4046, 0.2148, -5.7991, 14.1799, -13.7451, 4.6459];
const BLUE = [0.3341, 1.3846, 0.0951, -19.3324, 56.6906, -65.353, 26.3124];
/** From a pale grey, on which light and shadow are seen, to dark red. */
const HEAT = [[0.87, 0.87, 0.86], [0.99, 0.83, 0.55], [0.96, 0.55, 0.24], [0.83, 0.22, 0.12], [0.5, 0.02, 0.09]];
const STEPS = 256;

function polynomial(factors, x) {
  return factors.reduceRight((sum, factor) => sum * x + factor, 0);
}

function viridis(x) {
  return [RED, GREEN, BLUE].map((each) => Math.min(1, Math.max(0, polynomial(each, x))));
}

function heat(x) {
  const at = Math.min(x * (HEAT.length - 1), HEAT.length - 1 - 1e-9);
  const [from, to] = [HEAT[Math.floor(at)], HEAT[Math.floor(at) + 1]];
  return from.map((value, channel) => value + (at % 1) * (to[channel] - value));
}

/** `colors`: 256 rows of red, green, blue in 0..1, linear light for the renderer; `css`: for the legend. */
function ramp(color) {
  const colors = new Float32Array(3 * STEPS);
  const stops = [];
  for (let i = 0; i < STEPS; i++) {
    const rgb = color(i / (STEPS - 1));
    rgb.forEach((value, channel) => {
      colors[3 * i + channel] = value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
    });
    if (i % 15 === 0) stops.push(`rgb(${rgb.map((value) => Math.round(255 * value)).join(" ")})`);
  }
  return { colors, css: `linear-gradient(90deg, ${stops.join(", ")})` };
}

const EVERYWHERE = ramp(viridis);
const PLACES = ramp(heat);

/** Offset into a ramp's colours of a value in 0..1. */
export function rampIndex(value) {
  return 3 * Math.round(Math.min(1, Math.max(0, value)) * (STEPS - 1));
}

/** `least`: the smallest end of the legend, so that noise is not painted; of lengths, by the scene's. */
export const FIELDS = {
  displacement: { name: "Displacement", unit: "m", least: 1e-4, note: "from where the model placed it", ramp: EVERYWHERE },
  deformation: { name: "Deformation", unit: "m", least: 1e-4, note: "off the best rigid motion", ramp: EVERYWHERE },
  strain: { name: "Strain", unit: "", least: 1e-3, note: "equivalent, mean around each node", ramp: EVERYWHERE },
  stress: { name: "Stress", unit: "Pa", least: 1, note: "von Mises, mean around each node", ramp: EVERYWHERE },
  depth: { name: "Penetration", unit: "m", least: 1e-5, note: "deepest contact at each node", ramp: PLACES },
  force: { name: "Contact force", unit: "N", least: 1e-6, note: "on each node", ramp: PLACES },
};

/** What the colours end at: a few nodes may be above it, so that one of them does not darken all others. */
export function endOfScale(values) {
  const some = values.filter((value) => value > 0).sort();
  return some.length === 0 ? 0 : some[Math.floor(0.99 * (some.length - 1))];
}
