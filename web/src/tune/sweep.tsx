/** Frequency response of one axis: a sine of changing frequency while the button is held. */

import { useEffect, useMemo, useState } from "preact/hooks";
import type { Connection } from "../connection.ts";
import { Panel } from "../parts/common.tsx";
import type { Sweep } from "../protocol.ts";
import type { RingStore } from "../scope/store.ts";
import { text } from "../strings.ts";
import type { Unit } from "../views/axes/jogging.ts";
import { ScopeResponse } from "./bode.tsx";
import { BodeCurves } from "./bode_curves.tsx";
import { Entry, HoldButton } from "./controls.tsx";
import { differences, frequencyResponse, recorded, within } from "./frequency_response.ts";
import type { Identification } from "./identification.tsx";
import { MotionTest } from "./motion_test.ts";

const DEFAULT: Sweep = { start: 1, end: 50, duration: 10 };
const LONGEST = 60; // [s] of a capture by the server
const REST = 3; // [s] of the record before and after the sweep
const EDGE = 1.1; // the response ends at this multiple of the last frequency

interface SweepProps {
  connection: Connection;
  axis: number;
  unit: Unit;
  disabled: boolean;
  identification: Identification; // captures each sweep
}

export function SweepResponse({ connection, axis, unit, disabled, identification }: SweepProps) {
  const names = [`commanded_position[${axis}]`, `position[${axis}]`];
  const test = useMemo(() => new MotionTest(connection, axis, names), [connection, axis]);
  const [sweep, setSweep] = useState(DEFAULT);
  const [velocity, setVelocity] = useState(unit === "m" ? 0.05 : 0.5);
  useEffect(() => test.attach(), [test]);
  const { held, jogging } = test;
  const isDone = () => jogging.answers.peek().get(axis)?.status === "DONE";
  useEffect(() => held.subscribe((control) => {
    if (control === 0 && !isDone()) identification.stop();
  }), [test]);
  const begin = () => {
    test.begin(1, sweep.duration + REST, { velocity, distance: null, acceleration: null, sweep });
    void identification.capture(Math.min(sweep.duration, LONGEST));
  };
  const entry = (key: keyof Sweep, label: string) => (
    <Entry label={label} value={sweep[key]} onChange={(value) => setSweep({ ...sweep, [key]: value })} />
  );
  const store = test.store.value;
  return (
    <Panel title={text.tune.bode}>
      <div class="body stack">
        <div class="row wrap">
          {entry("start", text.tune.sweepStart)}
          {entry("end", text.tune.sweepEnd)}
          {entry("duration", text.tune.sweepDuration)}
          <Entry label={`${text.tune.velocity} [${unit}/s]`} value={velocity} onChange={setVelocity} />
          <HoldButton label={text.tune.sweep} disabled={disabled} held={held.value !== 0}
            begin={begin} end={() => test.end()} />
          <span role="status" class="small">{jogging.answers.value.get(axis)?.text}</span>
        </div>
        <p class="muted small">{text.tune.sweepHint}</p>
        {store !== null && <Response key={store.timeOf(store.begin)} store={store} names={names} sweep={sweep} />}
        <ScopeResponse connection={connection} />
      </div>
    </Panel>
  );
}

function Response({ store, names, sweep }: { store: RingStore; names: string[]; sweep: Sweep }) {
  const response = useMemo(() => responseOf(store, names, sweep), [store]);
  if (response === null) return <p class="empty">{text.tune.sweepTooShort}</p>;
  return (
    <>
      {store.lost > 0 && <p class="bad-text">{text.scope.lost(store.lost)}</p>}
      <BodeCurves response={response} isClosed />
    </>
  );
}

/** Return the response between the frequencies of a sweep; null if the record is too short. */
function responseOf(store: RingStore, names: string[], { start, end }: Sweep) {
  const [command, position] = recorded(store, names, store.begin, store.end);
  const response = frequencyResponse(differences(command!), differences(position!), store.period);
  if (response === null) return null;
  const found = within(response, Math.min(start, end) / EDGE, Math.max(start, end) * EDGE);
  return found.frequency.length < 3 ? null : found;
}
