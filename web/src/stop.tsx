/** Quick stop: a button that is always visible, and the Escape key. */

import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import type { Connection } from "./connection.ts";
import { notify } from "./notices.ts";
import { text } from "./strings.ts";

const SHOWN = 1500; // [ms]
const sent = signal(false);
let timer: ReturnType<typeof setTimeout> | undefined;

export function StopButton({ connection }: { connection: Connection }) {
  useEffect(() => {
    const onKey = (event: KeyboardEvent) => {
      if (event.key === "Escape" && !event.repeat) stop(connection);
    };
    window.addEventListener("keydown", onKey, { capture: true });
    return () => window.removeEventListener("keydown", onKey, { capture: true });
  }, [connection]);
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
        onPointerDown={() => stop(connection)}
        onClick={(event) => event.detail === 0 && stop(connection)}
      >
        {text.stop.title}
        <small aria-live="assertive">{sent.value ? text.stop.sent : text.stop.key}</small>
      </button>
    </div>
  );
}

function stop(connection: Connection): void {
  if (!connection.stop()) {
    notify(text.stop.failed, { hint: text.stop.failedHint, kind: "bad" });
    return;
  }
  sent.value = true;
  clearTimeout(timer);
  timer = setTimeout(() => (sent.value = false), SHOWN);
}
