/** Entry of an object dictionary: its value, and a field to change it. */

import { useComputed, useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { familyOf, parseValue, rangeOf } from "../../logic/values.ts";
import { notify, notifyError } from "../../notices.ts";
import type { ObjectEntry } from "../../remote.ts";
import { text } from "../../strings.ts";
import { keyOf, type ObjectList, type Reading } from "./object_list.ts";

const t = text.devices.objects;

export interface ObjectRowProps {
  list: ObjectList;
  entry: ObjectEntry;
  operator: boolean;
  editing: boolean;
  onEdit: (on: boolean) => void;
}

export function ObjectRow({ list, entry, operator, editing, onEdit }: ObjectRowProps) {
  const key = keyOf(entry);
  const reading = useComputed(() => list.readings.value.get(key));
  const favourite = useComputed(() => list.favourites.value.has(key));
  const readable = entry.access.includes("r");
  const writable = operator && entry.access.includes("w");
  const edit = async () => {
    if (readable && reading.value === undefined) await list.read(entry);
    onEdit(true);
  };
  return (
    <div class="object" role="listitem">
      <button
        type="button"
        class="button quiet small star"
        aria-label={`${t.favourite} ${key}`}
        aria-pressed={favourite.value}
        onClick={() => list.toggleFavourite(entry)}
      >
        {favourite.value ? "★" : "☆"}
      </button>
      <span class="mono object-key">{key}</span>
      <span class="object-name">
        {titleOf(entry)}
        <span class="small muted mono object-type">
          {entry.type} {entry.access}
        </span>
      </span>
      <Value entry={entry} reading={reading.value} />
      <span class="row object-actions">
        <button
          type="button"
          class="button small"
          disabled={!readable}
          aria-label={`${t.read} ${key}`}
          onClick={() => void list.read(entry)}
        >
          {t.read}
        </button>
        <button
          type="button"
          class="button small"
          disabled={!writable}
          aria-expanded={editing}
          aria-label={`${t.edit} ${key}`}
          onClick={() => (editing ? onEdit(false) : void edit())}
        >
          {t.edit}
        </button>
      </span>
      {editing && (
        <Editor list={list} entry={entry} reading={reading.value} onClose={() => onEdit(false)} />
      )}
    </div>
  );
}

function Value({ entry, reading }: { entry: ObjectEntry; reading: Reading | undefined }) {
  if (reading === undefined) return <span class="object-value muted">·</span>;
  if (reading.failed) return <span class="object-value bad-text small">{reading.text}</span>;
  const option = entry.options[String(reading.value)];
  return (
    <span class="object-value mono">
      {reading.text} {entry.unit}
      {option !== undefined && <span class="muted"> {option}</span>}
    </span>
  );
}

interface EditorProps {
  list: ObjectList;
  entry: ObjectEntry;
  reading: Reading | undefined;
  onClose: () => void;
}

function Editor({ list, entry, reading, onClose }: EditorProps) {
  const entered = useSignal(startOf(entry, reading));
  const parsed = useComputed(() => parseValue(entered.value, entry));
  const id = `edit-${entry.index}-${entry.subindex}`;
  const submit = async (event: SubmitEvent) => {
    event.preventDefault();
    if (parsed.value.value === null) return;
    try {
      await list.write(entry, parsed.value.value);
      notify(`${t.written} ${keyOf(entry)}`);
      onClose();
    } catch (error) {
      notifyError(error);
    }
  };
  const range = optionsOf(entry).length > 0 ? null : rangeOf(entry);
  return (
    <form class="object-editor" onSubmit={(event) => void submit(event)}>
      <Input entry={entry} id={id} value={entered.value} onInput={(value) => (entered.value = value)} />
      <span class="muted">{entry.unit}</span>
      <button type="submit" class="button small primary" disabled={parsed.value.value === null}>
        {t.write}
      </button>
      <button type="button" class="button small" onClick={onClose}>
        {text.common.cancel}
      </button>
      <span id={`${id}-help`} class="small muted">
        {parsed.value.error === null || entered.value === "" ? (
          range !== null && `${t.range} ${range}`
        ) : (
          <span class="bad-text">
            {t.errors[parsed.value.error]} {range !== null && `${t.range} ${range}`}
          </span>
        )}
      </span>
    </form>
  );
}

interface InputProps {
  entry: ObjectEntry;
  id: string;
  value: string;
  onInput: (value: string) => void;
}

function Input({ entry, id, value, onInput }: InputProps) {
  const options = optionsOf(entry);
  const label = `${keyOf(entry)} ${titleOf(entry)}`;
  const field = useRef<HTMLInputElement>(null);
  useEffect(() => field.current?.focus(), []);
  if (options.length > 0) {
    return (
      <select
        class="field grow"
        id={id}
        aria-label={label}
        value={value}
        onChange={(event) => onInput(event.currentTarget.value)}
      >
        {options.every(([known]) => known !== value) && <option value={value}>{value}</option>}
        {options.map(([known, name]) => (
          <option key={known} value={known}>
            {known}: {name}
          </option>
        ))}
      </select>
    );
  }
  return (
    <input
      class="field mono grow"
      id={id}
      aria-label={label}
      aria-describedby={`${id}-help`}
      aria-invalid={value !== "" && parseValue(value, entry).error !== null}
      autocomplete="off"
      ref={field}
      value={value}
      onInput={(event) => onInput(event.currentTarget.value)}
    />
  );
}

function optionsOf(entry: ObjectEntry): [string, string][] {
  const known = Object.entries(entry.options);
  if (known.length > 0 || familyOf(entry.type) !== "boolean") return known;
  return [
    ["0", "false"],
    ["1", "true"],
  ];
}

function startOf(entry: ObjectEntry, reading: Reading | undefined): string {
  const value = reading?.value;
  if (value === undefined || value === null || reading?.failed) return "";
  if (familyOf(entry.type) === "boolean") return value ? "1" : "0";
  return String(value);
}

/** Return the name of the entry; an object without entries has its own name. */
function titleOf({ object_name, name }: ObjectEntry): string {
  if (name === "" || name === object_name) return object_name;
  return object_name === "" ? name : `${object_name}: ${name}`;
}
