/** Diagnosis of the bus, check of the computer, and the report. */

import { useSignal } from "@preact/signals";
import type { Connection } from "../../connection.ts";
import { notifyError } from "../../notices.ts";
import { Chip, Panel, type Tone } from "../../parts/common.tsx";
import type { Check, Diagnosis, Examination } from "../../remote.ts";
import { text } from "../../strings.ts";

const TONES: Record<Check["status"], Tone> = { FAIL: "bad", WARN: "warn", PASS: "ok", SKIP: "" };
const ORDER: readonly Check["status"][] = ["FAIL", "WARN", "PASS"];

interface Item {
  tone: Tone;
  title: string;
  where: string;
  advice: string;
}

export function Health({ connection }: { connection: Connection }) {
  const items = useSignal<Item[] | null>(null);
  const busy = useSignal(false);
  const run = async (action: () => Promise<Item[]>) => {
    busy.value = true;
    try {
      items.value = await action();
    } catch (error) {
      notifyError(error);
    }
    busy.value = false;
  };
  return (
    <Panel title={text.overview.health}>
      <div class="body stack-small">
        <div class="row wrap">
          <button
            type="button"
            class="button"
            disabled={busy.value}
            onClick={() => void run(() => diagnosis(connection))}
          >
            {text.overview.diagnose}
          </button>
          <button
            type="button"
            class="button"
            disabled={busy.value || connection.role.value !== "operator"}
            onClick={() => void run(() => doctor(connection))}
          >
            {text.overview.doctor}
          </button>
          <a class="button" href="/report.html" download="catenary-report.html">
            {text.overview.report}
          </a>
        </div>
        <div aria-live="polite">
          {busy.value ? (
            <p class="muted">{text.overview.running}</p>
          ) : items.value === null ? (
            <p class="muted small">{text.overview.healthHint}</p>
          ) : (
            <Items items={items.value} />
          )}
        </div>
      </div>
    </Panel>
  );
}

function Items({ items }: { items: Item[] }) {
  if (items.length === 0) return <Chip tone="ok">{text.overview.noProblems}</Chip>;
  return (
    <ul class="findings">
      {items.map(({ tone, title, where, advice }, at) => (
        <li key={at}>
          <div class="row wrap">
            <Chip tone={tone}>{where}</Chip>
            <span>{title}</span>
          </div>
          {advice !== "" && <p class="advice">{advice}</p>}
        </li>
      ))}
    </ul>
  );
}

async function diagnosis(connection: Connection): Promise<Item[]> {
  const { problems } = await connection.call<Diagnosis>("diagnosis");
  return problems.map(({ what, where, advice }) => ({ tone: "bad", title: what, where, advice }));
}

/** Return the checks of `catenary doctor`, with failures first. */
async function doctor(connection: Connection): Promise<Item[]> {
  const { checks } = await connection.post<Examination>("/api/doctor");
  return checks
    .filter(({ status }) => status !== "SKIP")
    .sort((a, b) => ORDER.indexOf(a.status) - ORDER.indexOf(b.status))
    .map(({ id, status, found, advice }) => ({ tone: TONES[status], where: id, title: found, advice }));
}
