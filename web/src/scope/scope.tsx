/** Scope: any signals of the share at the full cycle rate. */

import { useEffect, useState } from "preact/hooks";
import type { Connection } from "../connection.ts";
import { text } from "../strings.ts";
import { Chart } from "./chart.tsx";
import { Toolbar, TriggerBar } from "./controls.tsx";
import type { ChartsModel } from "./charts_model.ts";
import { modelOf, type ScopeModel } from "./model.ts";
import { Picker } from "./picker.tsx";
import { Measurements } from "./table.tsx";

export function Scope({ connection }: { connection: Connection }) {
  const model = modelOf(connection);
  const theme = useTheme();
  useFrames(model);
  const layout = model.layout.value;
  if (layout === null) return <p class="scope-note">{text.scope.empty}</p>;
  return (
    <div class="scope">
      <h1>{text.scope.title}</h1>
      <Toolbar model={model} />
      <TriggerBar model={model} />
      <details class="scope-side" open={matchMedia("(min-width: 821px)").matches}>
        <summary>{text.scope.signals}</summary>
        <Picker model={model} />
      </details>
      <div class="scope-charts">
        {layout.charts.map((chart, index) => (
          <Chart key={chart.id} model={model} chart={chart} number={index + 1} theme={theme} />
        ))}
        <TimeCaption model={model} />
      </div>
      <Measurements model={model} />
    </div>
  );
}

function TimeCaption({ model }: { model: ScopeModel }) {
  const triggered = model.triggerState.value !== null && model.triggerState.value !== "free" && model.captures.value > 0;
  return <p class="scope-time">{triggered ? text.scope.fromTrigger : text.scope.time(model.origin.toFixed(0))}</p>;
}

/** Draw a frame before each repaint while the view is on the screen. */
export function useFrames(model: ChartsModel): void {
  useEffect(() => {
    let request = requestAnimationFrame(function draw() {
      model.frame();
      request = requestAnimationFrame(draw);
    });
    return () => cancelAnimationFrame(request);
  }, [model]);
}

/** Return a number that changes with the colours of the page. */
export function useTheme(): number {
  const [theme, setTheme] = useState(0);
  useEffect(() => {
    const changed = () => setTheme((each) => each + 1);
    window.addEventListener("themechange", changed);
    return () => window.removeEventListener("themechange", changed);
  }, []);
  return theme;
}
