/** Object browser of a device. */

import { useSignal } from "@preact/signals";
import { useEffect, useMemo } from "preact/hooks";
import type { Connection } from "../../connection.ts";
import type { Device } from "../../remote.ts";
import { text } from "../../strings.ts";
import { keyOf, ObjectList } from "./object_list.ts";
import { ObjectRow } from "./object_row.tsx";

export function Objects({ connection, device }: { connection: Connection; device: Device }) {
  const list = useMemo(() => new ObjectList(connection, device), [connection, device.position]);
  useEffect(() => {
    if (device.coe) void list.load();
  }, [list]);
  if (!device.coe) return <p class="empty">{text.devices.objects.none}</p>;
  return (
    <>
      <Tools list={list} />
      <Entries list={list} operator={connection.role.value === "operator"} />
      <Footer list={list} />
    </>
  );
}

function Tools({ list }: { list: ObjectList }) {
  const t = text.devices.objects;
  return (
    <div class="object-tools">
      <input
        class="field grow"
        type="search"
        placeholder={t.search}
        aria-label={t.search}
        value={list.search.value}
        onInput={(event) => list.find(event.currentTarget.value)}
      />
      <button
        type="button"
        class={list.onlyFavourites.value ? "button primary" : "button"}
        aria-pressed={list.onlyFavourites.value}
        onClick={() => list.toggleOnlyFavourites()}
      >
        ★ {t.favourites}
      </button>
      <button type="button" class="button" onClick={() => void list.readAll(list.shown.value)}>
        {t.readShown}
      </button>
    </div>
  );
}

function Entries({ list, operator }: { list: ObjectList; operator: boolean }) {
  const editing = useSignal<string | null>(null);
  if (list.shown.value.length === 0) {
    return (
      <p class="empty">{list.loading.value ? text.common.loading : text.devices.objects.empty}</p>
    );
  }
  return (
    <div class="objects" role="list">
      {list.shown.value.map((entry) => (
        <ObjectRow
          key={keyOf(entry)}
          list={list}
          entry={entry}
          operator={operator}
          editing={editing.value === keyOf(entry)}
          onEdit={(on) => (editing.value = on ? keyOf(entry) : null)}
        />
      ))}
    </div>
  );
}

function Footer({ list }: { list: ObjectList }) {
  return (
    <div class="row wrap object-footer muted small">
      <span>
        {list.entries.value.length} {text.devices.objects.loaded}
      </span>
      {list.next.value !== null && (
        <button
          type="button"
          class="button small"
          disabled={list.loading.value}
          onClick={() => void list.load()}
        >
          {text.devices.objects.more}
        </button>
      )}
      {list.notes.value.length > 0 && (
        <span>
          {text.devices.objects.notes} {list.notes.value.join("; ")}
        </span>
      )}
    </div>
  );
}
