/** What a scope measures of one signal in a window. */

export interface Measurements {
  minimum: number;
  maximum: number;
  mean: number;
  rms: number;
  peakToPeak: number;
  /** Of the rising crossings of the middle, with a tenth of the height as hysteresis; NaN below two of them. [Hz] */
  frequency: number;
}

/** Rows that are NaN are gaps and do not count. */
export function measure(values: Float64Array, ticks: Float64Array, periodS: number): Measurements {
  let minimum = Infinity;
  let maximum = -Infinity;
  let sum = 0;
  let squares = 0;
  let count = 0;
  for (const value of values) {
    if (Number.isNaN(value)) continue;
    if (value < minimum) minimum = value;
    if (value > maximum) maximum = value;
    sum += value;
    squares += value * value;
    ++count;
  }
  if (count === 0) return { minimum: NaN, maximum: NaN, mean: NaN, rms: NaN, peakToPeak: NaN, frequency: NaN };
  const peakToPeak = maximum - minimum;
  return {
    minimum, maximum, mean: sum / count, rms: Math.sqrt(squares / count), peakToPeak,
    frequency: frequencyOf(values, ticks, (maximum + minimum) / 2, peakToPeak / 10) / periodS,
  };
}

/** Periods in a tick. */
function frequencyOf(values: Float64Array, ticks: Float64Array, middle: number, hysteresis: number): number {
  let isLow = false;
  let crossings = 0;
  let first = 0;
  let last = 0;
  for (let i = 1; i < values.length; ++i) {
    if (values[i] < middle - hysteresis) isLow = true;
    if (!isLow || !(values[i] >= middle) || !(values[i - 1] < middle)) continue;
    isLow = false;
    const part = (middle - values[i - 1]) / (values[i] - values[i - 1]);
    last = ticks[i - 1] + part * (ticks[i] - ticks[i - 1]);
    if (crossings++ === 0) first = last;
  }
  return crossings < 2 ? NaN : (crossings - 1) / (last - first);
}
