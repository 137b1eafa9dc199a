/** Controls of a motion test: numbers, and a button that is held. */

import { isOtherButton } from "../views/axes/jog_controls.tsx";

interface EntryProps {
  label: string;
  value: number;
  onChange: (value: number) => void;
}

/** Entry of a positive number. */
export function Entry({ label, value, onChange }: EntryProps) {
  return (
    <label class="row">
      {label}
      <input class="field tune-entry" type="number" min="0" step="any" value={value}
        onChange={(event) => {
          const entered = event.currentTarget.valueAsNumber;
          if (entered > 0 && Number.isFinite(entered)) onChange(entered);
          else event.currentTarget.value = String(value);
        }} />
    </label>
  );
}

interface HoldProps {
  label: string;
  held: boolean;
  disabled: boolean;
  begin: () => void;
  end: () => void;
}

/** Button that works while it is held with a mouse, a pen or a key. */
export function HoldButton({ label, held, disabled, begin, end }: HoldProps) {
  const isKey = (event: KeyboardEvent) => event.key === " " || event.key === "Enter";
  return (
    <button type="button" class={held ? "button hold held" : "button hold"} disabled={disabled} aria-pressed={held}
      onPointerDown={(event) => {
        if (event.button !== 0 || event.pointerType === "touch") return;
        event.currentTarget.setPointerCapture(event.pointerId);
        begin();
      }}
      onPointerUp={end} onPointerMove={(event) => isOtherButton(event) && end()}
      onPointerCancel={end} onLostPointerCapture={end} onBlur={end}
      onKeyDown={(event) => {
        if (!isKey(event)) return end(); // with Meta held, macOS does not report that a key goes up
        event.preventDefault();
        if (!event.repeat) begin();
      }}
      onKeyUp={(event) => isKey(event) && end()}>
      {label}
    </button>
  );
}
