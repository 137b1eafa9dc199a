/** Tune: parameters of laws; step response, frequency response and identification of an axis. */

import { useComputed } from "@preact/signals";
import { useEffect, useMemo, useState } from "preact/hooks";
import type { Connection } from "../connection.ts";
import { shortened } from "../logic/format.ts";
import type { AxisInfo } from "../remote.ts";
import { useResource } from "../resource.ts";
import { text } from "../strings.ts";
import type { Unit } from "../views/axes/jogging.ts";
import { AxisState, EnableButton, useIsPowered } from "../views/axes/power.tsx";
import { Identification, IdentificationPanel } from "./identification.tsx";
import { Laws } from "./laws.tsx";
import { StepResponse } from "./step.tsx";
import { SweepResponse } from "./sweep.tsx";

export function Tune({ connection }: { connection: Connection }) {
  const names = connection.hello.value?.layout.axes ?? [];
  const infos = useResource<AxisInfo[]>(connection, "axes").value.value;
  const [chosen, setChosen] = useState(0);
  const axis = chosen < names.length ? chosen : 0;
  const unit = infos?.find((each) => each.name === names[axis])?.unit ?? "rad";
  return (
    <div class="tune">
      <h1 class="hidden-text">{text.tune.title}</h1>
      {names.length > 0 && (
        <>
          <AxisBar connection={connection} axis={axis} names={names} choose={setChosen} />
          <AxisTests key={`${axis} ${unit}`} connection={connection} axis={axis} name={names[axis]!} unit={unit} />
        </>
      )}
      <Laws connection={connection} />
    </div>
  );
}

interface BarProps {
  connection: Connection;
  axis: number;
  names: string[];
  choose: (axis: number) => void;
}

/** Choice of the axis, its state, and its power. */
function AxisBar({ connection, axis, names, choose }: BarProps) {
  const enabled = useIsPowered(connection, axis);
  const faulted = useComputed(() => (connection.status.value?.axes[axis]?.fault ?? "") !== "");
  const disabled = connection.role.value !== "operator";
  return (
    <div class="panel toolbar tune-axis">
      <label class="row">
        {text.tune.axis}
        <select class="field" value={axis} onChange={(event) => choose(Number(event.currentTarget.value))}>
          {names.map((name, index) => <option key={name} value={index}>{shortened(name)}</option>)}
        </select>
      </label>
      <AxisState connection={connection} axis={axis} />
      <EnableButton {...{ connection, axis, disabled }} name={names[axis]!} enabled={enabled} faulted={faulted.value} />
      {faulted.value && (
        <button type="button" class="button small primary" disabled={disabled}
          onClick={() => connection.request([axis], "reset")}>{text.axes.reset}</button>
      )}
      <WhyDisabled connection={connection} enabled={enabled} />
    </div>
  );
}

function WhyDisabled({ connection, enabled }: { connection: Connection; enabled: boolean }) {
  const reason = connection.hello.value?.reason_no_jog ?? null;
  if (reason !== null) return <span class="muted small">{text.jog.impossible} {reason}</span>;
  return enabled ? null : <span class="muted small">{text.tune.enableFirst}</span>;
}

interface TestsProps {
  connection: Connection;
  axis: number;
  name: string;
  unit: Unit;
}

function AxisTests({ connection, axis, name, unit }: TestsProps) {
  const identification = useMemo(() => new Identification(axis), [axis]);
  useEffect(() => () => identification.stop(), [identification]);
  const enabled = useIsPowered(connection, axis);
  const disabled = !enabled || (connection.hello.value?.reason_no_jog ?? null) !== null;
  return (
    <>
      <StepResponse {...{ connection, axis, unit, disabled }} />
      <SweepResponse {...{ connection, axis, unit, disabled, identification }} />
      <IdentificationPanel {...{ identification, name, unit }} />
    </>
  );
}
