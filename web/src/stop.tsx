/** Quick stop: a button that is always visible, and the Escape key. */

import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import type { Connection } from "./connection.ts";
import { notify } from "./notices.ts";
import { text } from "./strings.ts";

const SHOWN = 1500; // [ms]
const ANSWER = 500; // [ms] in which the server confirms
const sent = signal(false);
let timer: ReturnType<typeof setTimeout> | undefined;
let waiting: ReturnType<typeof setTimeout> | undefined;

export function StopButton({ connection }: { connection: Connection }) {
  useEffect(() => {
    const onKey = (event: KeyboardEvent) => {
      if (event.key === "Escape" && !event.repeat) stop(connection);
    };
    const end = connection.on("stopped", confirm);
    window.addEventListener("keydown", onKey, { capture: true });
    return () => {
      end();
      window.removeEventListener("keydown", onKey, { capture: true });
    };
  }, [connection]);
  const viewer = connection.role.value === "viewer";
  return (
    <div class="stop">
      <p class="note" id="stop-note">
        {text.stop.note}
      </p>
      <button
        type="button"
        class={sent.value ? "sent" : ""}
        aria-label={text.stop.label}
        aria-keyshortcuts="Escape"
        aria-describedby="stop-note"
        aria-disabled={viewer}
        onPointerDown={() => stop(connection)}
        onClick={(event) => event.detail === 0 && stop(connection)}
      >
        {text.stop.title}
        <small aria-live="assertive">
          {sent.value ? text.stop.sent : viewer ? text.stop.viewerKey : text.stop.key}
        </small>
      </button>
    </div>
  );
}

function stop(connection: Connection): void {
  if (connection.role.value === "viewer") warn(text.stop.viewer);
  else if (!connection.stop()) warn(text.stop.failed);
  else {
    clearTimeout(waiting);
    waiting = setTimeout(() => warn(text.stop.unconfirmed), ANSWER);
  }
}

function warn(message: string): void {
  notify(message, { hint: text.stop.failedHint, kind: "bad" });
}

/** Show that the server has passed the stop to the loop. */
function confirm(): void {
  clearTimeout(waiting);
  sent.value = true;
  clearTimeout(timer);
  timer = setTimeout(() => (sent.value = false), SHOWN);
}
