/** The amplitudes in a piece of a signal. */

/** Amplitudes at 0, `stepHz`, 2·`stepHz` and so on, up to half the rate of the samples. */
export interface Spectrum {
  amplitudes: Float64Array;
  stepHz: number;
  /** How many steps lie in one part of the resolution, which is the rate over the number of samples. */
  stepsInBin: number;
}

export interface Peak {
  frequency: number; // [Hz]
  amplitude: number;
}

const kLeastSamples = 16;
/** A main lobe of the Hann window reaches two bins to each side; beyond them its side lobes are lower than its slope here. */
const kLobeBins = 2;

/** The values after the last gap. */
export function sinceLastGap(values: Float64Array): Float64Array {
  let first = values.length;
  while (first > 0 && !Number.isNaN(values[first - 1])) --first;
  return values.subarray(first);
}

/**
 * A sine of amplitude A has the height A at its frequency: the Hann window halves the sum, and half of a real sine lies at
 * negative frequencies. The mean does not count. Zeros behind the samples make the steps at least twice as fine as the
 * resolution, so that a sine between two steps loses 4 % at most. null: too few samples.
 */
export function spectrumOf(values: Float64Array, periodS: number): Spectrum | null {
  const count = values.length;
  if (count < kLeastSamples) return null;
  const size = 2 ** Math.ceil(Math.log2(2 * count));
  const weights = values.map((_, i) => 0.5 - 0.5 * Math.cos((2 * Math.PI * i) / count));
  let sum = 0;
  for (let i = 0; i < count; ++i) sum += weights[i] * values[i];
  const mean = sum / (count / 2);
  const real = new Float64Array(size);
  for (let i = 0; i < count; ++i) real[i] = weights[i] * (values[i] - mean);
  const imaginary = new Float64Array(size);
  transform(real, imaginary);
  const amplitudes = new Float64Array(size / 2 + 1);
  for (let k = 0; k <= size / 2; ++k) amplitudes[k] = Math.hypot(real[k], imaginary[k]) / (count / 4);
  return { amplitudes, stepHz: 1 / (size * periodS), stepsInBin: size / count };
}

/** The amplitude at the step that is nearest to a frequency; NaN beyond the spectrum. */
export function amplitudeAt({ amplitudes, stepHz }: Spectrum, frequencyHz: number): number {
  return amplitudes[Math.round(frequencyHz / stepHz)] ?? NaN;
}

/**
 * The largest peaks, the largest first. Between the steps by a parabola through the fifth roots of three of them: the fifth root
 * of the Hann window's main lobe is a parabola up to terms of the sixth order.
 */
export function peaksOf({ amplitudes, stepHz, stepsInBin }: Spectrum, most: number): Peak[] {
  const reach = Math.ceil(kLobeBins * stepsInBin);
  const peaks: Peak[] = [];
  for (let k = 1; k < amplitudes.length - 1; ++k) {
    if (!(amplitudes[k] > amplitudes[k - 1] && amplitudes[k] >= amplitudes[k + 1])) continue;
    if (amplitudes.subarray(Math.max(k - reach, 0), k + reach + 1).some((each) => each > amplitudes[k])) continue;
    const [left, middle, right] = [k - 1, k, k + 1].map((each) => amplitudes[each] ** 0.2);
    const offset = (left - right) / (2 * (left - 2 * middle + right));
    peaks.push({ frequency: (k + offset) * stepHz, amplitude: (middle - ((left - right) * offset) / 4) ** 5 });
  }
  return peaks.sort((a, b) => b.amplitude - a.amplitude).slice(0, most);
}

/** Cooley and Tukey's transform in place; the length is a power of two. */
function transform(real: Float64Array, imaginary: Float64Array): void {
  const size = real.length;
  for (let i = 1, j = 0; i < size; ++i) {
    let bit = size >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) [real[i], real[j], imaginary[i], imaginary[j]] = [real[j], real[i], imaginary[j], imaginary[i]];
  }
  const cosines = Float64Array.from({ length: size / 2 }, (_, i) => Math.cos((2 * Math.PI * i) / size));
  const sines = Float64Array.from({ length: size / 2 }, (_, i) => -Math.sin((2 * Math.PI * i) / size));
  for (let half = 1; half < size; half *= 2) {
    const stride = size / (2 * half);
    for (let start = 0; start < size; start += 2 * half) {
      for (let i = 0; i < half; ++i) {
        const a = start + i;
        const b = a + half;
        const re = real[b] * cosines[i * stride] - imaginary[b] * sines[i * stride];
        const im = real[b] * sines[i * stride] + imaginary[b] * cosines[i * stride];
        real[b] = real[a] - re;
        imaginary[b] = imaginary[a] - im;
        real[a] += re;
        imaginary[a] += im;
      }
    }
  }
}
