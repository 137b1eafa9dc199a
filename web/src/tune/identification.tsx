/** Inertia and friction of one axis, from values that the server captures while the axis moves. */

import { type Signal, signal } from "@preact/signals";
import { useState } from "preact/hooks";
import { fixed } from "../logic/format.ts";
import { notifyError } from "../notices.ts";
import { Panel } from "../parts/common.tsx";
import type { ErrorBody } from "../protocol.ts";
import { RemoteError } from "../connection.ts";
import { text } from "../strings.ts";
import type { Unit } from "../views/axes/jogging.ts";
import { Entry } from "./controls.tsx";

interface Identified {
  inertia: number;
  viscous: number;
  coulomb: number;
  offset: number;
  errors: [number, number, number, number]; // standard errors
  determination: number;
}

interface Figures {
  axis: string;
  rows: number;
  lost: number;
  identified: Identified | null;
  problems: string[];
}

const UNITS: Record<Unit, readonly string[]> = {
  rad: ["kg·m²", "N·m·s/rad", "N·m", "N·m"],
  m: ["kg", "N·s/m", "N", "N"],
};

/** Owns the figures of one axis. */
export class Identification {
  readonly busy = signal(false);
  readonly figures: Signal<Figures | null> = signal(null);
  private aborting = new AbortController();

  constructor(private readonly axis: number) {}

  /** Capture the axis for a time [s]. A second capture during the first has no effect. */
  async capture(seconds: number): Promise<void> {
    if (this.busy.peek()) return;
    this.busy.value = true;
    const { signal } = (this.aborting = new AbortController());
    try {
      this.figures.value = await requestFigures(this.axis, seconds, signal);
    } catch (error) {
      if (!signal.aborted) notifyError(error);
    } finally {
      this.busy.value = false;
    }
  }

  /** End a capture without figures. */
  stop(): void {
    this.aborting.abort();
  }
}

async function requestFigures(axis: number, seconds: number, signal: AbortSignal): Promise<Figures> {
  const reply = await fetch("/api/tune/capture", {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ axis, seconds }),
    signal,
  });
  const answer = (await reply.json()) as Figures | { error: ErrorBody };
  if ("error" in answer) throw new RemoteError(answer.error);
  return answer;
}

interface PanelProps {
  identification: Identification;
  name: string;
  unit: Unit;
}

export function IdentificationPanel({ identification, name, unit }: PanelProps) {
  const [seconds, setSeconds] = useState(10);
  const { figures, busy } = identification;
  const report = (
    <a class="button small" href={`/api/tune/report?axis=${encodeURIComponent(name)}`} target="_blank" rel="noopener">
      {text.tune.report}
    </a>
  );
  return (
    <Panel title={text.tune.identification} actions={figures.value !== null && report}>
      <div class="body stack">
        <div class="row wrap">
          <Entry label={text.tune.captureSeconds} value={seconds} onChange={setSeconds} />
          <button type="button" class="button" disabled={busy.value} onClick={() => void identification.capture(seconds)}>
            {text.tune.identify}
          </button>
          <span role="status" class="small">{busy.value && text.tune.capturing}</span>
        </div>
        <p class="muted small">{text.tune.identifyHint}</p>
        {figures.value !== null && <Result figures={figures.value} unit={unit} />}
      </div>
    </Panel>
  );
}

function Result({ figures, unit }: { figures: Figures; unit: Unit }) {
  const found = figures.identified;
  const numbers = found === null ? [] : [found.inertia, found.viscous, found.coulomb, found.offset];
  return (
    <>
      {found !== null && (
        <dl class="tune-figures">
          {numbers.map((number, index) => (
            <div key={index}>
              <dt>{text.tune.identified[index]}</dt>
              <dd class="mono">{withError(number, found.errors[index]!)} {UNITS[unit][index]}</dd>
            </div>
          ))}
          <div>
            <dt>{text.tune.determination}</dt>
            <dd class="mono">{fixed(found.determination, 3)}</dd>
          </div>
        </dl>
      )}
      {figures.problems.map((problem) => <p key={problem} class="muted">{problem}</p>)}
    </>
  );
}

/** Return a number and its standard error with the digits that the error allows. */
function withError(number: number, error: number): string {
  const digits = error > 0 ? Math.min(6, Math.max(0, 1 - Math.floor(Math.log10(error)))) : 4;
  return `${fixed(number, digits)} ± ${fixed(error, digits)}`;
}
