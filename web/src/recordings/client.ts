/** Requests for recordings (src/catenary/dashboard/recordings.py). */

import { decodeFrame, type Frame } from "../frame.ts";
import type { Layout } from "../protocol.ts";

export interface RecordingFile {
  name: string;
  size: number; // bytes
  modified: number; // UTC [s]
}

export interface RecordingEvent {
  time: number; // after the first cycle [s]
  kind: string;
  message: string;
}

export interface RecordingInfo {
  layout: Layout;
  duration: number; // [s]
  started: number; // UTC [s]
  ended: boolean;
  lost: number;
  events: RecordingEvent[];
}

export interface WindowRequest {
  signals: string[];
  start: number; // after the first cycle [s]
  end: number;
  points: number;
}

const PATH = "/api/recordings";

export async function listRecordings(): Promise<RecordingFile[]> {
  return (await json<{ files: RecordingFile[] }>(await fetch(PATH))).files;
}

export async function openRecording(name: string): Promise<RecordingInfo> {
  return json<RecordingInfo>(await fetch(`${PATH}/${encodeURIComponent(name)}`));
}

/** Read a window. A large one is read in steps; `progress` gets the part that is complete. */
export async function readWindow(
  name: string, request: WindowRequest, signal: AbortSignal, progress: (part: number) => void,
): Promise<Frame> {
  for (;;) {
    const reply = await fetch(`${PATH}/${encodeURIComponent(name)}/window`, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(request),
      signal,
    });
    if (reply.status !== 202) {
      if (!reply.ok) await json(reply);
      return decodeFrame(await reply.arrayBuffer());
    }
    progress((await json<{ progress: number }>(reply)).progress);
  }
}

/** Return the result of an answer. Throws Error with the text of the server. */
async function json<T>(reply: Response): Promise<T> {
  const answer = (await reply.json().catch(() => ({}))) as {
    result?: T;
    error?: { message: string };
  };
  if (!reply.ok || answer.error !== undefined) {
    throw new Error(answer.error?.message ?? `HTTP ${reply.status}`);
  }
  return answer.result ?? (answer as T);
}
