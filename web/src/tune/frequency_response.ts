/** Frequency response from two recorded signals, by averaged cross spectra (Welch), and its margins. */

import type { RingStore } from "../scope/store.ts";

export interface FrequencyResponse {
  frequency: number[]; // [Hz]
  gain: number[]; // magnitude [dB]
  phase: number[]; // unwrapped [degrees]
  coherence: number[]; // 0 to 1
  real: number[];
  imaginary: number[];
}

export interface Margins {
  gain: number; // [dB] at the phase crossover; NaN without one
  gainFrequency: number; // [Hz]
  phase: number; // [degrees] at the gain crossover; NaN without one
  phaseFrequency: number; // [Hz]
}

const DEGREES = 180 / Math.PI;
const SEGMENTS = 8; // at least, so that the coherence has a meaning
const SMALLEST = 64; // rows of a segment
const COHERENT = 0.6; // smallest coherence of frequencies that count for the margins
const EXCITED = 1e-6; // part of the largest power; other frequencies are left out

/** Return the response of `output` to `input`, which are sampled with `period` [s]; null if too short. */
export function frequencyResponse(input: Float64Array, output: Float64Array, period: number): FrequencyResponse | null {
  const size = 2 ** Math.floor(Math.log2((2 * input.length) / (SEGMENTS + 1)));
  if (size < SMALLEST) return null;
  const half = size / 2;
  const sums = spectra(input, output, size);
  const largest = sums.uu.reduce((most, each) => Math.max(most, each), 0);
  const result: FrequencyResponse = { frequency: [], gain: [], phase: [], coherence: [], real: [], imaginary: [] };
  for (let bin = 1; bin < half; bin++) {
    const power = sums.uu[bin]!;
    if (power <= EXCITED * largest) continue;
    const real = sums.real[bin]! / power;
    const imaginary = sums.imaginary[bin]! / power;
    result.frequency.push(bin / (size * period));
    result.real.push(real);
    result.imaginary.push(imaginary);
    result.coherence.push((sums.real[bin]! ** 2 + sums.imaginary[bin]! ** 2) / (power * sums.yy[bin]! || 1));
  }
  return { ...result, ...bode(result.real, result.imaginary) };
}

/** Return the part of a response between two frequencies [Hz]. */
export function within(response: FrequencyResponse, low: number, high: number): FrequencyResponse {
  const part = (values: number[]) =>
    values.filter((_, index) => response.frequency[index]! >= low && response.frequency[index]! <= high);
  const [real, imaginary] = [part(response.real), part(response.imaginary)];
  const { frequency, coherence } = response;
  return { frequency: part(frequency), coherence: part(coherence), real, imaginary, ...bode(real, imaginary) };
}

/**
 * Return the differences of successive values. Those of input and output have the same response as the
 * signals themselves, without the large power of slow motions.
 */
export function differences(values: Float64Array): Float64Array {
  return values.subarray(1).map((value, index) => value - values[index]!);
}

/** Return the values of signals in the rows that contain all of them. */
export function recorded(store: RingStore, names: readonly string[], from: number, to: number): Float64Array[] {
  const rows = Array.from({ length: Math.max(0, to - from) }, (_, index) => from + index);
  const kept = rows.filter((row) => names.every((name) => !Number.isNaN(store.value(name, row))));
  return names.map((name) => Float64Array.from(kept, (row) => store.value(name, row)));
}

/** Return the open loop of a closed loop with unity feedback: T / (1 - T). */
export function openLoop(closed: FrequencyResponse): FrequencyResponse {
  const real: number[] = [];
  const imaginary: number[] = [];
  closed.real.forEach((a, index) => {
    const b = closed.imaginary[index]!;
    const size = (1 - a) ** 2 + b ** 2;
    real.push((a * (1 - a) - b * b) / size);
    imaginary.push(b / size);
  });
  return { ...closed, real, imaginary, ...bode(real, imaginary) };
}

/** Return gain and phase margin of an open loop, between the measured frequencies with coherence. */
export function margins(loop: FrequencyResponse): Margins {
  const coherent = (values: number[]) => values.filter((_, index) => (loop.coherence[index] ?? 1) >= COHERENT);
  const frequency = coherent(loop.frequency);
  const { gain, phase } = bode(coherent(loop.real), coherent(loop.imaginary));
  const unity = crossing(gain, 0);
  const opposite = crossing(phase, -180);
  return {
    gain: -at(gain, opposite),
    gainFrequency: at(frequency, opposite),
    phase: wrapped(180 + at(phase, unity)),
    phaseFrequency: at(frequency, unity),
  };
}

/** Return the same angle between -180 and 180 degrees. */
function wrapped(angle: number): number {
  return angle - 360 * Math.round(angle / 360);
}

function bode(real: number[], imaginary: number[]): { gain: number[]; phase: number[] } {
  const gain = real.map((a, index) => 20 * Math.log10(Math.hypot(a, imaginary[index]!)));
  let turns = 0;
  let before = 0;
  const phase = real.map((a, index) => {
    const angle = Math.atan2(imaginary[index]!, a) * DEGREES;
    if (index > 0 && angle - before > 180) turns--;
    if (index > 0 && angle - before < -180) turns++;
    before = angle;
    return angle + 360 * turns;
  });
  return { gain, phase };
}

/** Return the fractional index at which values fall below a level first; NaN without a crossing. */
function crossing(values: number[], level: number): number {
  const index = values.findIndex((value, at) => at > 0 && value <= level && values[at - 1]! > level);
  if (index < 0) return NaN;
  return index - 1 + (values[index - 1]! - level) / (values[index - 1]! - values[index]!);
}

function at(values: number[], index: number): number {
  const low = Math.floor(index);
  if (Number.isNaN(index)) return NaN;
  return values[low]! + (index - low) * ((values[low + 1] ?? values[low]!) - values[low]!);
}

/** Return the sums of the spectra of all segments, which overlap by at least half (Hann window). */
function spectra(input: Float64Array, output: Float64Array, size: number) {
  const half = size / 2;
  const [uu, yy, real, imaginary] = Array.from({ length: 4 }, () => new Float64Array(half)) as [
    Float64Array, Float64Array, Float64Array, Float64Array,
  ];
  const segments = Math.ceil((input.length - size) / half) + 1;
  for (let segment = 0; segment < segments; segment++) {
    const start = Math.round((segment * (input.length - size)) / Math.max(1, segments - 1));
    const [ur, ui] = transformed(input.subarray(start, start + size));
    const [yr, yi] = transformed(output.subarray(start, start + size));
    for (let bin = 0; bin < half; bin++) {
      uu[bin]! += ur[bin]! ** 2 + ui[bin]! ** 2;
      yy[bin]! += yr[bin]! ** 2 + yi[bin]! ** 2;
      real[bin]! += yr[bin]! * ur[bin]! + yi[bin]! * ui[bin]!;
      imaginary[bin]! += yi[bin]! * ur[bin]! - yr[bin]! * ui[bin]!;
    }
  }
  return { uu, yy, real, imaginary };
}

/** Return real and imaginary part of the spectrum of a segment without its mean. */
function transformed(segment: Float64Array): [Float64Array, Float64Array] {
  const size = segment.length;
  const mean = segment.reduce((sum, each) => sum + each, 0) / size;
  const real = segment.map((value, index) => (value - mean) * Math.sin((Math.PI * index) / size) ** 2);
  const imaginary = new Float64Array(size);
  transform(real, imaginary);
  return [real, imaginary];
}

/** Fast Fourier transform in place; the size is a power of two (Cooley and Tukey, 1965). */
function transform(real: Float64Array, imaginary: Float64Array): void {
  const size = real.length;
  for (let index = 1, mirror = 0; index < size; index++) {
    let bit = size >> 1;
    for (; mirror & bit; bit >>= 1) mirror ^= bit;
    mirror ^= bit;
    if (index < mirror) swap(real, imaginary, index, mirror);
  }
  for (let length = 2; length <= size; length *= 2) {
    for (let start = 0; start < size; start += length) butterflies(real, imaginary, start, length);
  }
}

function swap(real: Float64Array, imaginary: Float64Array, a: number, b: number): void {
  [real[a], real[b]] = [real[b]!, real[a]!];
  [imaginary[a], imaginary[b]] = [imaginary[b]!, imaginary[a]!];
}

function butterflies(real: Float64Array, imaginary: Float64Array, start: number, length: number): void {
  const half = length / 2;
  for (let index = 0; index < half; index++) {
    const angle = (-Math.PI * index) / half;
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    const [a, b] = [start + index, start + index + half];
    const r = real[b]! * c - imaginary[b]! * s;
    const i = real[b]! * s + imaginary[b]! * c;
    real[b] = real[a]! - r;
    imaginary[b] = imaginary[a]! - i;
    real[a]! += r;
    imaginary[a]! += i;
  }
}
