/** List of signals with a search. */

import { useState } from "preact/hooks";
import { text } from "../strings.ts";
import { search, type Group } from "./catalog.ts";
import { MAX_TRACES, recording, toggled, traceCount } from "./layout.ts";
import type { ChartsModel } from "./charts_model.ts";

export function Picker({ model }: { model: ChartsModel }) {
  const [query, setQuery] = useState("");
  const groups = search(model.groups.value, query);
  const full = traceCount(model.layout.value!) >= MAX_TRACES;
  return (
    <div class="scope-picker">
      <input class="field" type="search" value={query} aria-label={text.scope.search} placeholder={text.scope.search}
        onInput={(event) => setQuery(event.currentTarget.value)} />
      {full && <p class="scope-note" role="status">{text.scope.full}</p>}
      {groups.length === 0 && <p class="scope-note">{text.scope.noMatch}</p>}
      {groups.map((group) => (
        <GroupList key={group.field} model={model} group={group} open={query !== ""} full={full} />
      ))}
    </div>
  );
}

interface Props {
  model: ChartsModel;
  group: Group;
  open: boolean;
  full: boolean;
}

function GroupList({ model, group, open, full }: Props) {
  const [expanded, setExpanded] = useState(false);
  const shown = open || expanded;
  return (
    <details open={shown} onToggle={(event) => setExpanded(event.currentTarget.open)}>
      <summary>
        <span>{group.field}</span>
        <small>{group.unit !== "" && `[${group.unit}]`} {group.signals.length > 1 && group.signals.length}</small>
      </summary>
      {shown && <Signals model={model} group={group} full={full} />}
    </details>
  );
}

function Signals({ model, group, full }: Omit<Props, "open">) {
  const layout = model.layout.value!;
  const ids = group.signals.map((each) => each.id);
  const shown = layout.charts.find((chart) => chart.id === model.active.value)?.traces ?? [];
  const recorded = ids.every((id) => layout.recorded.includes(id));
  return (
    <ul>
      {ids.length > 1 && (
        <li>
          <label title={text.scope.recordHint}>
            <input type="checkbox" checked={recorded}
              onChange={(event) => model.change(recording(layout, ids, event.currentTarget.checked))} />
            <em>{text.scope.record}</em>
          </label>
        </li>
      )}
      {group.signals.map((each) => (
        <li key={each.id}>
          <label>
            <input type="checkbox" checked={shown.includes(each.id)} disabled={full && !shown.includes(each.id)}
              onChange={() => model.change(toggled(layout, model.active.value, each.id))} />
            {each.label.replace(`${group.field} · `, "")}
          </label>
        </li>
      ))}
    </ul>
  );
}
