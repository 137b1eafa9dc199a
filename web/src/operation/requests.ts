/** Requests for operating modes and presets. The program of the loop decides about them. */

import { signal } from "@preact/signals";
import { RemoteError } from "../connection.ts";
import { text } from "../strings.ts";

export type Kind = "mode" | "preset";
export type Outcome = "requested" | "accepted" | "refused" | "unanswered" | "failed";

/** A mode or a preset. */
export interface Target {
  kind: Kind;
  name: string;
}

export interface Report extends Target {
  outcome: Outcome;
  reason: string; // of a refusal or failure
}

/** Part of the connection that the requests need. */
export interface Caller {
  call<T>(method: string, params: object): Promise<T>;
}

const OUTCOMES: Readonly<Record<string, Outcome>> = {
  RequestRefused: "refused",
  ResponseTimeout: "unanswered",
};

export class OperationRequests {
  readonly report = signal<Report | null>(null); // of the last request
  private readonly caller: Caller;
  private number = 0; // of the newest request; only its answer is reported

  constructor(caller: Caller) {
    this.caller = caller;
  }

  /** Return true while the answer of the program is awaited. */
  get waits(): boolean {
    return this.report.value?.outcome === "requested";
  }

  /** Request a mode or a preset, and report the answer. A request while one waits has no effect. */
  async request({ kind, name }: Target): Promise<void> {
    if (this.report.peek()?.outcome === "requested") return;
    const number = ++this.number;
    this.report.value = { kind, name, outcome: "requested", reason: "" };
    const found = await this.answer({ kind, name });
    if (number === this.number) this.report.value = { kind, name, ...found };
  }

  /** Report that the answer to an open request is lost. */
  interrupt(): void {
    const report = this.report.peek();
    if (report?.outcome !== "requested") return;
    this.number++;
    this.report.value = { ...report, outcome: "unanswered", reason: text.operation.interrupted };
  }

  /** Forget the last request. */
  forget(): void {
    this.number++;
    this.report.value = null;
  }

  private async answer({ kind, name }: Target): Promise<{ outcome: Outcome; reason: string }> {
    try {
      if (kind === "mode") await this.caller.call("set_mode", { mode: name });
      else await this.caller.call("run_preset", { preset: name });
      return { outcome: "accepted", reason: "" };
    } catch (error) {
      return failure(error);
    }
  }
}

function failure(error: unknown): { outcome: Outcome; reason: string } {
  const reason = error instanceof Error ? error.message : String(error);
  const outcome = error instanceof RemoteError ? OUTCOMES[error.kind] : undefined;
  return { outcome: outcome ?? "failed", reason };
}
