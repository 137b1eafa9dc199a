import assert from "node:assert/strict";
import { test } from "node:test";
import { differences, frequencyResponse, margins, openLoop, within } from "../src/tune/frequency_response.ts";

const PERIOD = 0.001;
const LENGTH = 40_000;

/** Return a sweep from 1 to 100 Hz. */
function sweep(): Float64Array {
  const rate = Math.log(100) / (LENGTH * PERIOD);
  return Float64Array.from({ length: LENGTH }, (_, row) => Math.sin((2 * Math.PI * (Math.exp(rate * row * PERIOD) - 1)) / rate));
}

/** Return the response of 1 / (1 + s / (2 pi corner)), exact for inputs that are constant in a period. */
function lowPass(input: Float64Array, corner: number): Float64Array {
  const decay = Math.exp(-2 * Math.PI * corner * PERIOD);
  let state = 0;
  return input.map((value) => {
    const before = state;
    state = decay * state + (1 - decay) * value;
    return before;
  });
}

function near(frequencies: number[], frequency: number): number {
  return frequencies.findIndex((each) => each >= frequency);
}

test("a low-pass has -3 dB and -45 degrees at its corner", () => {
  const input = sweep();
  const response = frequencyResponse(input, lowPass(input, 10), PERIOD)!;
  const corner = near(response.frequency, 10);
  assert.ok(Math.abs(response.gain[corner]! + 3.01) < 0.1, String(response.gain[corner]));
  assert.ok(Math.abs(response.phase[corner]! + 45 + 1.8) < 2, String(response.phase[corner]));
  assert.ok(response.coherence[corner]! > 0.99);
});

test("the differences of a slow drift with a sweep have the response of the sweep", () => {
  const input = sweep().map((value, row) => value + 1e-7 * row ** 2);
  const response = frequencyResponse(differences(input), differences(lowPass(input, 10)), PERIOD)!;
  for (const [frequency, gain] of [[10, -3.01], [30, -10]] as const) {
    const index = near(response.frequency, frequency);
    assert.ok(Math.abs(response.gain[index]! - gain) < 0.2, String(response.gain[index]));
  }
});

test("a part of a response has only its frequencies", () => {
  const input = sweep();
  const part = within(frequencyResponse(input, lowPass(input, 10), PERIOD)!, 5, 20);
  assert.ok(part.frequency[0]! >= 5 && part.frequency.at(-1)! <= 20);
  const lengths = [part.gain, part.phase, part.coherence, part.real, part.imaginary].map((each) => each.length);
  assert.deepEqual(new Set(lengths), new Set([part.frequency.length]));
});

test("a delay turns the phase beyond -180 degrees", () => {
  const input = sweep();
  const output = Float64Array.from(input, (_, row) => input[row - 10] ?? 0);
  const response = frequencyResponse(input, output, PERIOD)!;
  const index = near(response.frequency, 80);
  const expected = -360 * response.frequency[index]! * 0.01;
  assert.ok(Math.abs(response.phase[index]! - expected) < 3, String(response.phase[index]));
});

test("noise without a relation has a low coherence", () => {
  let seed = 1;
  const random = () => ((seed = (seed * 16807) % 2147483647) / 2147483647) - 0.5;
  const [input, output] = [1, 2].map(() => Float64Array.from({ length: LENGTH }, random)) as [Float64Array, Float64Array];
  const { coherence } = frequencyResponse(input, output, PERIOD)!;
  assert.ok(coherence.reduce((sum, each) => sum + each, 0) / coherence.length < 0.3);
});

test("a short record has no response", () => {
  assert.equal(frequencyResponse(new Float64Array(100), new Float64Array(100), PERIOD), null);
});

test("the margins of an integrator with delay are those of the formula", () => {
  const frequency = Array.from({ length: 4000 }, (_, index) => 0.05 * (index + 1));
  const [crossover, delay] = [10, 0.005]; // [Hz], [s]
  const real = frequency.map((f) => (crossover / f) * Math.cos(-Math.PI / 2 - 2 * Math.PI * f * delay));
  const imaginary = frequency.map((f) => (crossover / f) * Math.sin(-Math.PI / 2 - 2 * Math.PI * f * delay));
  const loop = openLoop(closedLoop(frequency, real, imaginary));
  const found = margins(loop);
  assert.ok(Math.abs(found.phaseFrequency - crossover) < 0.05);
  assert.ok(Math.abs(found.phase - (90 - 360 * crossover * delay)) < 0.5);
  assert.ok(Math.abs(found.gainFrequency - 1 / (4 * delay)) < 0.1);
  assert.ok(Math.abs(found.gain - 20 * Math.log10(1 / (4 * delay) / crossover)) < 0.05);
});

function closedLoop(frequency: number[], real: number[], imaginary: number[]) {
  const pairs = real.map((a, index) => {
    const b = imaginary[index]!;
    const size = (1 + a) ** 2 + b ** 2;
    return [(a * (1 + a) + b * b) / size, b / size] as const;
  });
  return {
    frequency, gain: [], phase: [], coherence: [],
    real: pairs.map(([a]) => a), imaginary: pairs.map(([, b]) => b),
  };
}
