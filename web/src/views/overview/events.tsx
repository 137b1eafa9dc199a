/** Events of the loop in plain words, with what to do. */

import type { Connection } from "../../connection.ts";
import { timeOfDay } from "../../logic/format.ts";
import { Chip, Panel, type Tone } from "../../parts/common.tsx";
import type { Event } from "../../protocol.ts";
import { address } from "../../route.ts";
import { text } from "../../strings.ts";

const SHOWN = 100;
const BAD = /Lost|Fault|Error|Broken|Damaged|Stopped|Refused|Died|Left/;
const GOOD = /Returned|Healed|Restored|Closed|Recovered/;

export function Events({ connection }: { connection: Connection }) {
  const offset = (connection.hello.value?.layout.utc_offset_ns ?? 0) * 1e-9;
  const events = connection.events.value.slice(0, SHOWN);
  return (
    <Panel title={text.overview.events}>
      {events.length === 0 ? (
        <p class="empty">{text.overview.eventsNone}</p>
      ) : (
        <ol class="events" aria-live="polite">
          {events.map((event) => (
            <Entry key={event.serial} event={event} offset={offset} />
          ))}
        </ol>
      )}
    </Panel>
  );
}

function Entry({ event, offset }: { event: Event; offset: number }) {
  return (
    <li>
      <div class="row wrap">
        <Chip tone={toneOf(event.kind)}>{spaced(event.kind)}</Chip>
        {event.position === null ? null : (
          <a class="small" href={address("devices", event.position)}>
            {text.overview.device} {event.position}
          </a>
        )}
        <time class="small muted mono right">
          {timeOfDay(event.time + offset)} · {text.overview.cycle} {event.number}
        </time>
      </div>
      <p>{event.message}</p>
      {event.advice !== "" && <p class="advice">{event.advice}</p>}
    </li>
  );
}

function toneOf(kind: string): Tone {
  if (GOOD.test(kind)) return "ok";
  return BAD.test(kind) ? "bad" : "info";
}

/** Return the name of a class as words: "DeviceLost" → "Device lost". */
export function spaced(name: string): string {
  const words = name.replace(/([a-z0-9])([A-Z])/g, "$1 $2").toLowerCase();
  return words.charAt(0).toUpperCase() + words.slice(1);
}
