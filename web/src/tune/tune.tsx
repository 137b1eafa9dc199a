/** Tune: parameters of laws, and the step response of an axis. */

import "uplot/dist/uPlot.min.css";
import "../scope/scope.css";
import "./tune.css";
import { useState } from "preact/hooks";
import type { Connection } from "../connection.ts";
import type { AxisInfo } from "../remote.ts";
import { useResource } from "../resource.ts";
import { text } from "../strings.ts";
import { BodePlot } from "./bode.tsx";
import { Laws } from "./laws.tsx";
import { StepResponse } from "./step.tsx";

export function Tune({ connection }: { connection: Connection }) {
  const names = connection.hello.value?.layout.axes ?? [];
  const infos = useResource<AxisInfo[]>(connection, "axes").value.value;
  const [axis, setAxis] = useState(0);
  const unit = infos?.find((each) => each.name === names[axis])?.unit ?? "rad";
  return (
    <div class="tune">
      <h1 class="hidden-text">{text.tune.title}</h1>
      <Laws connection={connection} />
      {names.length > 0 && (
        <>
          <label class="row tune-axis">
            {text.tune.axis}
            <select class="field" value={axis} onChange={(event) => setAxis(Number(event.currentTarget.value))}>
              {names.map((name, index) => <option key={name} value={index}>{name}</option>)}
            </select>
          </label>
          <StepResponse key={`${axis} ${unit}`} connection={connection} axis={axis} unit={unit} />
        </>
      )}
      <BodePlot connection={connection} />
    </div>
  );
}
