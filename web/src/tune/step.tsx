/** Step response of one axis: a jog of a fixed distance while the button is held. */

import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import type { Connection } from "../connection.ts";
import { duration, fixed, quantity } from "../logic/format.ts";
import { Panel } from "../parts/common.tsx";
import { KIND_FULL } from "../protocol.ts";
import { Plot } from "../scope/plot.ts";
import { RingStore } from "../scope/store.ts";
import { useTheme } from "../scope/scope.tsx";
import { text } from "../strings.ts";
import { isOtherButton } from "../views/axes/jog_controls.tsx";
import { Jogging, type Unit } from "../views/axes/jogging.ts";
import { type StepFigures, stepFigures } from "./step_response.ts";

const BEFORE = 0.1; // [s] of record before the step
const AFTER = 1; // [s] after the button is released

export function StepResponse({ connection, axis, unit }: { connection: Connection; axis: number; unit: Unit }) {
  const jogging = useMemo(() => new Jogging(connection), [connection]);
  const [distance, setDistance] = useState(unit === "m" ? 0.001 : 0.02);
  const [velocity, setVelocity] = useState(unit === "m" ? 0.05 : 0.5);
  const [store, setStore] = useState<RingStore | null>(null);
  const record = useRef<(() => void) | null>(null);
  const noJog = connection.hello.value?.reason_no_jog ?? null;
  useEffect(() => jogging.attach(), [jogging]);
  useEffect(() => () => record.current?.(), [connection, axis]);
  const begin = (sign: 1 | -1) => {
    record.current?.();
    record.current = recordAxis(connection, axis, (recorded) => setStore(recorded));
    const jog = { velocity: sign * velocity, distance, acceleration: null };
    const releases = jogging.releases; // a release in the meantime also cancels this press
    held.current = true;
    setTimeout(() => {
      if (held.current && jogging.releases === releases) jogging.press(axis, sign, jog, false);
    }, 1000 * BEFORE);
  };
  const held = useRef(false);
  const end = () => {
    if (!held.current) return;
    held.current = false;
    jogging.release();
    const stop = record.current;
    setTimeout(() => stop?.(), 1000 * AFTER);
  };
  const answer = jogging.answers.value.get(axis);
  return (
    <Panel title={text.tune.step}>
      <div class="body">
        {noJog !== null && <p class="muted">{noJog}</p>}
        <div class="row wrap">
          <Entry label={`${text.tune.distance} [${unit}]`} value={distance} onChange={setDistance} />
          <Entry label={`${text.tune.velocity} [${unit}/s]`} value={velocity} onChange={setVelocity} />
          {([-1, 1] as const).map((sign) => (
            <HoldButton key={sign} label={sign < 0 ? text.tune.stepDown : text.tune.stepUp} disabled={noJog !== null}
              begin={() => begin(sign)} end={end} />
          ))}
          <span role="status" class="small">{answer?.text}</span>
        </div>
        <p class="muted small">{text.tune.stepHint}</p>
        {store !== null && <Response store={store} axis={axis} unit={unit} />}
      </div>
    </Panel>
  );
}

/** Button that works while it is held with a mouse, a pen or a key. */
function HoldButton(props: { label: string; disabled: boolean; begin: () => void; end: () => void }) {
  const isKey = (event: KeyboardEvent) => event.key === " " || event.key === "Enter";
  return (
    <button type="button" class="button" disabled={props.disabled}
      onPointerDown={(event) => {
        if (event.button !== 0 || event.pointerType === "touch") return;
        event.currentTarget.setPointerCapture(event.pointerId);
        props.begin();
      }}
      onPointerUp={props.end} onPointerMove={(event) => isOtherButton(event) && props.end()}
      onPointerCancel={props.end} onLostPointerCapture={props.end} onBlur={props.end}
      onKeyDown={(event) => {
        if (!isKey(event)) return;
        event.preventDefault();
        if (!event.repeat) props.begin();
      }}
      onKeyUp={(event) => isKey(event) && props.end()}>
      {props.label}
    </button>
  );
}

function Entry(props: { label: string; value: number; onChange: (value: number) => void }) {
  return (
    <label class="row">
      {props.label}
      <input class="field tune-entry" type="number" min="0" step="any" value={props.value}
        onChange={(event) => {
          const entered = event.currentTarget.valueAsNumber;
          if (entered > 0 && Number.isFinite(entered)) props.onChange(entered);
        }} />
    </label>
  );
}

function Response({ store, axis, unit }: { store: RingStore; axis: number; unit: Unit }) {
  const place = useRef<HTMLDivElement>(null);
  const theme = useTheme();
  const names = signalNames(axis);
  const figures = stepFigures(store, names[0]!, names[1]!);
  useEffect(() => {
    const plot = new Plot(place.current!, [unit]);
    plot.setTraces(names.map((signal, colour) => ({ signal, unit, colour })));
    const origin = store.timeOf(store.begin);
    plot.draw({
      store, origin, span: { start: origin, end: store.lastTime },
      cursors: [], trigger: null, fine: true,
    });
    return () => plot.destroy();
  }, [store, unit, theme]);
  return (
    <>
      <div ref={place} class="tune-plot" role="img" aria-label={text.tune.step} />
      {figures === null ? <p class="empty">{text.tune.noStep}</p> : <Figures figures={figures} unit={unit} />}
    </>
  );
}

function Figures({ figures, unit }: { figures: StepFigures; unit: string }) {
  const rows: [string, string][] = [
    [text.tune.figures.size, `${quantity(figures.size, unit)} ${unit}`],
    [text.tune.figures.rise, duration(figures.rise)],
    [text.tune.figures.overshoot, `${fixed(100 * figures.overshoot, 1)} %`],
    [text.tune.figures.settling, duration(figures.settling)],
    [text.tune.figures.largest, `${fixed(figures.largest, 6)} ${unit}`],
    [text.tune.figures.error, `${fixed(figures.error, 6)} ${unit}`],
  ];
  return (
    <dl class="tune-figures">
      {rows.map(([name, value]) => <div key={name}><dt>{name}</dt><dd class="mono">{value}</dd></div>)}
    </dl>
  );
}

function signalNames(axis: number): string[] {
  return [`commanded_position[${axis}]`, `position[${axis}]`];
}

/** Record command and position of an axis. Return a function that ends the record. */
function recordAxis(connection: Connection, axis: number, done: (store: RingStore) => void): () => void {
  const names = signalNames(axis);
  const store = new RingStore(20, connection.hello.peek()!.layout.period);
  for (const name of names) store.add(name);
  const end = connection.subscribe(names, { full: true, rate: 60 }, (frame) => {
    if (frame.kind !== KIND_FULL) return;
    store.append({ time: frame.time, names, values: frame.columns, lost: frame.lost });
  });
  let ended = false;
  return () => {
    if (ended) return;
    ended = true;
    end();
    if (store.end > 1) done(store);
  };
}
