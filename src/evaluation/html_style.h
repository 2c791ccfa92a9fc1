#pragma once

namespace scanner::evaluation::html {

/// For the screen of a phone or a desk, and for paper.
inline constexpr const char* kStyle = R"(
:root{--ink:#1e293b;--soft:#64748b;--rule:#dfe4ea;--paper:#fff;--ground:#f6f7f9;--accent:#2563a8}
*{box-sizing:border-box}
body{margin:0;background:var(--ground);color:var(--ink);font:16px/1.55 system-ui,-apple-system,
"Segoe UI",Roboto,"Helvetica Neue",Arial,sans-serif}
main{max-width:1080px;margin:0 auto;padding:24px 16px 48px}
header h1{font-size:1.7rem;line-height:1.2;margin:.2em 0 .1em;overflow-wrap:anywhere}
header p{color:var(--soft);margin:0 0 1em}
section{background:var(--paper);border:1px solid var(--rule);border-radius:8px;padding:4px 20px 18px;
margin:18px 0}
h2{font-size:1.2rem;margin:.8em 0 .5em}
h3{font-size:1rem;margin:1.4em 0 .3em}
.verdict{font-size:1.08rem;background:var(--paper);border:1px solid var(--rule);border-radius:8px;
padding:16px 20px;margin:0}
a{color:var(--accent)}
.badge{display:inline-block;padding:.05em .65em;border-radius:1em;color:#fff;margin-right:.4em}
.sound{background:#2f7d4f}.check{background:#b3660a}.unusable{background:#b42318}
.figures{display:grid;grid-template-columns:repeat(auto-fit,minmax(128px,1fr));gap:12px;margin:18px 0}
.figures div{background:var(--paper);border:1px solid var(--rule);border-radius:8px;padding:10px 14px}
.figures dt{color:var(--soft);font-size:.85rem}
.figures dd{margin:0;font-size:1.35rem;font-weight:600}
.figures dd.more{font-size:.85rem;font-weight:400;color:var(--soft)}
figure{margin:0}
figure img{display:block;width:100%;height:auto;border-radius:6px;border:1px solid var(--rule)}
figcaption{color:var(--soft);font-size:.85rem;padding:.35em 0 .6em}
.pictures{display:grid;grid-template-columns:repeat(auto-fit,minmax(max(150px,22%),1fr));gap:12px}
.plots{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,430px),1fr));gap:14px}
.plot svg{display:block;width:100%;height:auto;font-family:inherit}
.scroll{overflow-x:auto}
table{border-collapse:collapse;font-size:.88rem;font-variant-numeric:tabular-nums;min-width:50%}
th,td{padding:.28em .8em;text-align:right;border-bottom:1px solid var(--rule)}
th{font-weight:600;color:var(--soft);vertical-align:bottom}
td:first-child,th:first-child{text-align:left;white-space:nowrap}
.words td,.second td:nth-child(2),.second th:nth-child(2){text-align:left}
.words td:nth-child(2){white-space:nowrap;font-weight:600}
.words td:nth-child(3){color:var(--soft)}
.summary td{background:#f4f6f8}
tbody.summary td:first-child{font-weight:600}
em{color:var(--soft);font-style:italic;font-weight:400}
.note{color:var(--soft);font-size:.9rem;margin:.2em 0 .6em;max-width:70ch}
details{margin:.6em 0}
details>summary{cursor:pointer;color:var(--accent)}
pre{overflow-x:auto;font-size:.82rem;background:var(--ground);padding:12px;border-radius:6px}
.notes{padding-left:1.2em;overflow-wrap:anywhere}
footer{color:var(--soft);font-size:.85rem}
@media(max-width:600px){section{padding:2px 12px 12px}th,td{padding:.28em .5em}body{font-size:15px}}
@media print{body{background:#fff;font-size:10.5pt}main{max-width:none;padding:0}
section,.verdict,.figures div{border-color:#bbb;break-inside:auto}figure,.plot,tr{break-inside:avoid}
.scroll{overflow:visible}.badge{border:1px solid #000;color:#000;background:none}}
)";

}  // namespace scanner::evaluation::html
