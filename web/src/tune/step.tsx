/** Step response of one axis: a jog of a fixed distance while the button is held. */

import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import type { Connection } from "../connection.ts";
import { duration, fixed, quantity } from "../logic/format.ts";
import { Panel } from "../parts/common.tsx";
import { Plot } from "../scope/plot.ts";
import type { RingStore } from "../scope/store.ts";
import { useTheme } from "../scope/scope.tsx";
import { text } from "../strings.ts";
import type { Unit } from "../views/axes/jogging.ts";
import { Entry, HoldButton } from "./controls.tsx";
import { MotionTest } from "./motion_test.ts";
import { type StepFigures, stepFigures } from "./step_response.ts";

const SECONDS = 20; // of record at most

interface StepProps {
  connection: Connection;
  axis: number;
  unit: Unit;
  disabled: boolean;
}

export function StepResponse({ connection, axis, unit, disabled }: StepProps) {
  const test = useMemo(() => new MotionTest(connection, axis, signalNames(axis)), [connection, axis]);
  const [distance, setDistance] = useState(unit === "m" ? 0.001 : 0.02);
  const [velocity, setVelocity] = useState(unit === "m" ? 0.05 : 0.5);
  useEffect(() => test.attach(), [test]);
  const begin = (sign: 1 | -1) =>
    test.begin(sign, SECONDS, { velocity: sign * velocity, distance, acceleration: null });
  const store = test.store.value;
  return (
    <Panel title={text.tune.step}>
      <div class="body stack">
        <div class="row wrap">
          <Entry label={`${text.tune.distance} [${unit}]`} value={distance} onChange={setDistance} />
          <Entry label={`${text.tune.velocity} [${unit}/s]`} value={velocity} onChange={setVelocity} />
          {([-1, 1] as const).map((sign) => (
            <HoldButton key={sign} label={sign < 0 ? text.tune.stepDown : text.tune.stepUp} disabled={disabled}
              held={test.held.value === sign} begin={() => begin(sign)} end={() => test.end()} />
          ))}
          <span role="status" class="small">{test.jogging.answers.value.get(axis)?.text}</span>
        </div>
        <p class="muted small">{text.tune.stepHint}</p>
        {store !== null && <Response store={store} axis={axis} unit={unit} />}
      </div>
    </Panel>
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
