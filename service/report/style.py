"""The report's style sheet: light, printable, no fonts or images from outside."""

CSS = """
:root { --ink: #1c2733; --soft: #66727f; --line: #dfe4ea; }
* { box-sizing: border-box; }
body { margin: 0; background: #fff; color: var(--ink); font: 15px/1.5 system-ui, "Segoe UI", "DejaVu Sans", Arial, sans-serif; }
main { max-width: 980px; margin: 0 auto; padding: 28px 32px 48px; }
h1 { font-size: 26px; margin: 0; } h2 { font-size: 19px; margin: 38px 0 6px; padding-top: 10px; border-top: 2px solid var(--line); }
h3 { font-size: 16px; margin: 0 0 4px; } p { margin: 6px 0; }
.meta, .note { color: var(--soft); font-size: 13px; } .meta span { display: inline-block; margin-right: 16px; }
.head { display: flex; justify-content: space-between; align-items: flex-start; gap: 20px; } .head > div:first-child { min-width: 0; }
.simulated { border: 3px solid #b8860b; color: #8a6508; font-weight: 700; font-size: 20px; letter-spacing: .12em; padding: 4px 14px;
  border-radius: 6px; transform: rotate(-2deg); white-space: nowrap; }
.verdict { border-left: 10px solid; padding: 14px 20px; margin: 20px 0; border-radius: 4px; font-size: 19px; line-height: 1.4; }
.verdict b { display: block; font-size: 14px; letter-spacing: .08em; text-transform: uppercase; margin-bottom: 4px; }
.consistent { border-color: #2e8b57; background: #eef8f2; } .explained { border-color: #1f77b4; background: #eef5fb; }
.partly_explained { border-color: #d9822b; background: #fdf4ea; } .unexplained { border-color: #c0504d; background: #fbefee; }
.card { border: 1px solid var(--line); border-radius: 8px; padding: 16px 20px; margin: 14px 0; break-inside: avoid; }
.card.open { border-color: #c0504d; } .lead { font-size: 16px; margin: 4px 0 10px; }
table { border-collapse: collapse; width: 100%; font-size: 13.5px; } th { text-align: left; color: var(--soft); font-weight: 600; }
th, td { padding: 4px 10px 4px 0; border-bottom: 1px solid var(--line); vertical-align: middle; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
svg { max-width: 100%; height: auto; display: block; margin: 8px 0; font-family: inherit; } td svg { margin: 0; width: 120px; }
.warn { background: #fff8e5; border-left: 5px solid #d9a92b; padding: 6px 14px; margin: 6px 0; font-size: 14px; }
.tag { display: inline-block; background: #eef1f4; border-radius: 10px; padding: 1px 10px; margin: 2px 6px 2px 0; font-size: 13px; }
figure { margin: 8px 0; break-inside: avoid; } figure svg { width: 100%; } table.small { width: auto; } table.small td, table.small th { padding-right: 28px; }
footer { margin-top: 40px; border-top: 2px solid var(--line); padding-top: 8px; color: var(--soft); font-size: 12px; word-break: break-all; }
@media print { main { max-width: none; padding: 0; } body { font-size: 11pt; } h2 { break-after: avoid; }
  * { -webkit-print-color-adjust: exact; print-color-adjust: exact; } @page { size: A4; margin: 14mm; } tr { break-inside: avoid; } }
"""
