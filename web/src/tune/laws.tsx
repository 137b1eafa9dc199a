/** Parameters of the laws: sliders with numeric entry, applied together. */

import { useEffect, useMemo, useState } from "preact/hooks";
import type { Connection } from "../connection.ts";
import { notifyError } from "../notices.ts";
import { Chip, Failure, Panel } from "../parts/common.tsx";
import { useResource } from "../resource.ts";
import { text } from "../strings.ts";
import { Draft, isAllowed, type Parameter, type Parameters, present, sliderRange, type Values } from "./draft.ts";

const INTERVAL = 2000; // [ms]
const SLIDER_STEPS = 1000;

interface Law {
  name: string;
  running: boolean;
  parameters: Parameters;
}

export function Laws({ connection }: { connection: Connection }) {
  const laws = useResource<Law[]>(connection, "laws", {}, INTERVAL);
  const found = laws.value.value;
  return (
    <>
      <Failure error={laws.error.value} />
      {found?.length === 0 && <p class="panel empty">{text.tune.noLaws}</p>}
      {found?.map((law) => <LawPanel key={law.name} connection={connection} law={law} reload={laws.reload} />)}
    </>
  );
}

function LawPanel({ connection, law, reload }: { connection: Connection; law: Law; reload: () => Promise<void> }) {
  const draft = useMemo(() => new Draft(law.parameters), [law.name]);
  const [, render] = useState(0);
  const changed = () => render((each) => each + 1);
  useEffect(() => {
    draft.update(law.parameters);
    changed();
  }, [law.parameters]);
  const apply = async (values: Values, done: () => void) => {
    try {
      await connection.call("set_parameters", { law: law.name, values });
      done();
      await reload();
    } catch (error) {
      notifyError(error);
    }
    changed();
  };
  const operator = connection.role.value === "operator";
  const actions = operator && (
    <>
      <button type="button" class="button small" disabled={!draft.canUndo}
        onClick={() => void apply(draft.lastValues(), () => draft.undone())}>{text.tune.undo}</button>
      <button type="button" class="button small" disabled={draft.edited === 0}
        onClick={() => (draft.reset(), changed())}>{text.tune.discard}</button>
      <button type="button" class="button small primary" disabled={draft.edited === 0 || !draft.isValid()}
        onClick={() => {
          const changes = draft.changes();
          void apply(changes, () => draft.applied(changes));
        }}>{text.tune.apply(draft.edited)}</button>
    </>
  );
  return (
    <Panel title={law.name} actions={actions}>
      <div class="body tune-law">
        <Chip tone={law.running ? "ok" : ""}>{law.running ? text.tune.running : text.tune.stopped}</Chip>
        {Object.entries(law.parameters).map(([name, parameter]) =>
          present(parameter).map((_, index) => (
            <Row key={`${name}[${index}]`} {...{ draft, name, index, parameter, changed, disabled: !operator }} />
          )))}
      </div>
    </Panel>
  );
}

interface RowProps {
  draft: Draft;
  name: string;
  index: number;
  parameter: Parameter;
  changed: () => void;
  disabled: boolean;
}

function Row({ draft, name, index, parameter, changed, disabled }: RowProps) {
  const value = draft.value(name, index);
  const now = present(parameter)[index]!;
  const [low, high] = sliderRange(parameter, now);
  const label = Array.isArray(parameter.value) ? `${name}[${index}]` : name;
  const set = (entered: number) => {
    draft.set(name, index, entered);
    changed();
  };
  return (
    <div class={draft.isEdited(name, index) ? "tune-row edited" : "tune-row"}>
      <span class="mono">{label} {parameter.unit !== "" && <small class="muted">{parameter.unit}</small>}</span>
      <input type="range" min={low} max={high} step={(high - low) / SLIDER_STEPS} value={value} disabled={disabled}
        aria-label={label} onInput={(event) => set(event.currentTarget.valueAsNumber)} />
      <input class="field" type="number" step="any" value={value} disabled={disabled} aria-label={text.tune.entry(label)}
        min={parameter.minimum ?? undefined} max={parameter.maximum ?? undefined}
        aria-invalid={!isAllowed(parameter, value)}
        onChange={(event) => set(event.currentTarget.valueAsNumber)} />
      <span class="muted small">{draft.isEdited(name, index) && text.tune.now(String(now))}</span>
    </div>
  );
}
