//! A report: one self-contained HTML page.

use std::fmt::Write as _;

use super::canvas::Picture;
use super::format::{escape, with_minus};
use super::living::{self, Bundle, Living};
use super::palette;

/// Tone of a verdict box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// No problem.
    Good,
    /// Something was found.
    Finding,
    /// Something is wrong or remains unexplained.
    Warning,
}

/// A column of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Column<'a> {
    /// Words, set left.
    Text(&'a str),
    /// Numbers, set right.
    Number(&'a str),
}

/// Builder of a report. All text is escaped; text between backticks is set as code.
///
/// ```
/// use host_fit::picture::{Report, Tone};
/// let mut report = Report::new("Diagnosis", "ramp, U = 10 m/s");
/// report
///     .answer(Tone::Finding, "plenum-droop is missing", &[("Evidence", "RMSE 0.027 → 0.010")], &[""; 0])
///     .section("What was tried")
///     .paragraph("Every effect of `host-fit effects` was refitted.");
/// let html = report.html();
/// assert!(html.starts_with("<!doctype html>"));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Report {
    title: String,
    subtitle: String,
    body: String,
    sections: Vec<String>,
    /// Sections in the table of contents; folded ones are not listed.
    listed: Vec<usize>,
    folds: usize,
    open: bool,
    groups: usize,
    provenance: Vec<(String, String)>,
}

impl Report {
    /// An empty report; `subtitle` names its subject in a line.
    #[must_use]
    pub fn new(title: &str, subtitle: &str) -> Self {
        Self {
            title: title.to_owned(),
            subtitle: subtitle.to_owned(),
            ..Self::default()
        }
    }

    /// The answer, in a box: the verdict, its labelled parts (evidence, confidence, next), and notes that open on a click. A
    /// part called "Next" is a command and is set as code.
    pub fn answer<S: AsRef<str>>(
        &mut self,
        tone: Tone,
        verdict: &str,
        parts: &[(&str, &str)],
        notes: &[S],
    ) -> &mut Self {
        let class = match tone {
            Tone::Good => "good",
            Tone::Finding => "finding",
            Tone::Warning => "warning",
        };
        self.push(format_args!(
            "<div class=\"verdict {class}\"><p class=\"headline\">{}</p><dl>",
            inline(verdict)
        ));
        for (label, text) in parts {
            let text = match *label {
                "Next" => format!("<code>{}</code>", escape(text)),
                _ => inline(text),
            };
            self.push(format_args!("<dt>{}</dt><dd>{text}</dd>", inline(label)));
        }
        self.push(format_args!("</dl>"));
        if !notes.is_empty() {
            let count = notes.len();
            let plural = if count == 1 { "" } else { "s" };
            self.push(format_args!(
                "<details><summary>{count} note{plural}</summary>"
            ));
            self.list(notes);
            self.push(format_args!("</details>"));
        }
        self.push(format_args!("</div>\n"))
    }

    /// Starts a group that is laid out in columns if the page is wide enough, until [`Report::end_columns`].
    pub fn columns(&mut self) -> &mut Self {
        self.push(format_args!("<div class=\"columns\">"))
    }

    /// Ends the group of [`Report::columns`].
    pub fn end_columns(&mut self) -> &mut Self {
        self.push(format_args!("</div>\n"))
    }

    /// One cell of [`Report::columns`] with several elements; ends with [`Report::end_columns`].
    pub fn cell(&mut self) -> &mut Self {
        self.push(format_args!("<div class=\"cell\">"))
    }

    /// Starts a folded part until [`Report::end_fold`]; it opens on a click and in print.
    pub fn fold(&mut self, summary: &str) -> &mut Self {
        self.close_section();
        self.folds += 1;
        self.push(format_args!(
            "<details class=\"fold\"><summary>{}</summary>\n",
            inline(summary)
        ))
    }

    /// Ends what [`Report::fold`] began.
    pub fn end_fold(&mut self) -> &mut Self {
        self.close_section();
        self.folds = self.folds.saturating_sub(1);
        self.push(format_args!("</details>\n"))
    }

    /// Starts a section; the page lists them when there are several.
    pub fn section(&mut self, heading: &str) -> &mut Self {
        self.close_section();
        self.open = true;
        self.sections.push(heading.to_owned());
        let number = self.sections.len();
        if self.folds == 0 {
            self.listed.push(number);
        }
        self.push(format_args!(
            "<section id=\"s{number}\"><h2>{}</h2>\n",
            inline(heading)
        ))
    }

    /// Starts a part of a section.
    pub fn subsection(&mut self, heading: &str) -> &mut Self {
        self.push(format_args!("<h3>{}</h3>\n", inline(heading)))
    }

    /// A paragraph.
    pub fn paragraph(&mut self, text: &str) -> &mut Self {
        self.push(format_args!("<p>{}</p>\n", inline(text)))
    }

    /// A list of points.
    pub fn list<S: AsRef<str>>(&mut self, points: &[S]) -> &mut Self {
        self.push(format_args!("<ul>"));
        for point in points {
            self.push(format_args!("<li>{}</li>", inline(point.as_ref())));
        }
        self.push(format_args!("</ul>\n"))
    }

    /// A table with a caption (empty for none). Rows may be shorter than `columns`;
    /// cells beyond them are dropped.
    pub fn table<S: AsRef<str>>(
        &mut self,
        caption: &str,
        columns: &[Column<'_>],
        rows: &[Vec<S>],
    ) -> &mut Self {
        // The caption is outside the table element: a table may be wider than a phone, but its caption
        // must be readable without scrolling.
        if !caption.is_empty() {
            self.push(format_args!("<p class=\"caption\">{}</p>", inline(caption)));
        }
        self.push(format_args!("<div class=\"table\"><table>"));
        self.push(format_args!("<thead><tr>"));
        for column in columns {
            match column {
                Column::Text(name) => {
                    self.push(format_args!("<th scope=\"col\">{}</th>", head(name)))
                }
                Column::Number(name) => self.push(format_args!(
                    "<th scope=\"col\" class=\"n\">{}</th>",
                    head(name)
                )),
            };
        }
        self.push(format_args!("</tr></thead><tbody>"));
        for row in rows {
            self.push(format_args!("<tr>"));
            for (index, column) in columns.iter().enumerate() {
                let cell = inline(row.get(index).map_or("", AsRef::as_ref));
                match column {
                    Column::Text(_) => self.push(format_args!("<td>{cell}</td>")),
                    Column::Number(_) => {
                        self.push(format_args!("<td class=\"n\">{}</td>", with_minus(cell)))
                    }
                };
            }
            self.push(format_args!("</tr>\n"));
        }
        self.push(format_args!("</tbody></table></div>\n"))
    }

    /// A picture with a caption (empty for none).
    pub fn figure(&mut self, picture: &Picture, caption: &str) -> &mut Self {
        self.push(format_args!("<figure>{}", picture.html()));
        if !caption.is_empty() {
            self.push(format_args!("<figcaption>{}</figcaption>", inline(caption)));
        }
        self.push(format_args!("</figure>\n"))
    }

    /// Interactive records: zoom, values, models on and off. Returns the group's name, for [`Report::bars`].
    pub fn living(&mut self, living: &Living) -> String {
        self.groups += 1;
        let name = format!("g{}", self.groups);
        self.push(format_args!(
            "<div class=\"living\" id=\"{name}\"></div><noscript><p>The curves need this page's script, but \
             scripts are switched off.</p></noscript><script type=\"application/json\" \
             id=\"{name}-data\">{}</script>\n",
            living.json()
        ));
        name
    }

    /// As [`Report::figure`], for a picture whose bars mark their samples in the records of the following group.
    pub fn bars(&mut self, picture: &Picture, caption: &str) -> &mut Self {
        let group = self.groups + 1;
        let at = self.body.len();
        self.figure(picture, caption);
        if let Some(figure) = self.body.get(at..).filter(|f| f.starts_with("<figure>")) {
            let marked =
                figure.replacen("<figure>", &format!("<figure data-group=\"g{group}\">"), 1);
            self.body.truncate(at);
            self.body.push_str(&marked);
        }
        self
    }

    /// Commands, generated code or a model, verbatim.
    pub fn code(&mut self, text: &str) -> &mut Self {
        self.push(format_args!("<pre>{}</pre>\n", escape(text)))
    }

    /// A line at the foot of the page: tool version, data hash, seed, command.
    pub fn provenance(&mut self, name: &str, value: &str) -> &mut Self {
        let line = (name.to_owned(), value.to_owned());
        // Several parts of a page often have the same line.
        if !self.provenance.contains(&line) {
            self.provenance.push(line);
        }
        self
    }

    /// The whole page.
    #[must_use]
    pub fn html(&self) -> String {
        let mut body = String::with_capacity(self.body.len() + 2048);
        let _ = write!(body, "<header><h1>{}</h1>", escape(&self.title));
        if !self.subtitle.is_empty() {
            let _ = write!(body, "<p class=\"subtitle\">{}</p>", inline(&self.subtitle));
        }
        body.push_str("</header>\n");
        let listed = self.listed.len() > 2;
        if listed {
            body.push_str("<div class=\"listed\"><nav aria-label=\"Contents\"><ul>");
            for number in &self.listed {
                let heading = self.sections.get(number - 1).map_or("", String::as_str);
                let _ = write!(
                    body,
                    "<li><a href=\"#s{number}\">{}</a></li>",
                    inline(heading)
                );
            }
            body.push_str("</ul></nav>\n<div class=\"content\">");
        }
        body.push_str(&self.body);
        if self.open {
            body.push_str("</section>\n");
        }
        if listed {
            body.push_str("</div></div>\n");
        }
        if !self.provenance.is_empty() {
            body.push_str("<footer><dl>");
            for (name, value) in &self.provenance {
                let _ = write!(body, "<dt>{}</dt><dd>{}</dd>", inline(name), inline(value));
            }
            body.push_str("</dl></footer>\n");
        }
        page(&self.title, &living::REPORT, "", "report", &body)
    }

    fn close_section(&mut self) {
        if self.open {
            self.push(format_args!("</section>\n"));
        }
        self.open = false;
    }

    fn push(&mut self, text: std::fmt::Arguments<'_>) -> &mut Self {
        // Writing to a string cannot fail.
        let _ = self.body.write_fmt(text);
        self
    }
}

/// The workbench's page around `body`, which is HTML: the same style, and a script that may send requests to its
/// server.
#[must_use]
pub fn workbench_page(title: &str, body: &str) -> String {
    let policy = "; connect-src 'self'; base-uri 'none'; form-action 'none'";
    page(title, &living::WORKBENCH, policy, "bench", body)
}

fn page(title: &str, bundle: &Bundle, policy: &str, class: &str, body: &str) -> String {
    let title = escape(title);
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <meta http-equiv=\"Content-Security-Policy\" \
         content=\"default-src 'none'; style-src 'unsafe-inline'; img-src data:; script-src '{hash}'{policy}\">\n\
         <link rel=\"icon\" href=\"data:,\">\n\
         <title>{title}</title>\n<style>{style}{STYLE}:root,:root.on-paper{{{LIGHT}{light}}}\
         @media screen and (prefers-color-scheme:dark){{:root{{{DARK}{dark}}}{rules}}}</style>\n\
         <script type=\"module\">{script}</script></head>\n\
         <body><main class=\"{class}\">\n{body}</main></body></html>\n",
        hash = bundle.hash.trim(),
        style = bundle.style,
        light = palette::variables(false),
        dark = palette::variables(true),
        rules = palette::dark_rules("figure svg"),
        script = bundle.script,
    )
}

/// Heads of columns with their explanation, as in the glossary (docs/glossary.md).
const HEADS: [(&str, &str); 9] = [
    ("FIT, %", "100 · (1 − ‖y − ŷ‖ / ‖y − mean y‖), %; eq. (10)"),
    ("RMSE", "root mean square of the residual, in the unit of y"),
    (
        "inside",
        "share of the samples at which ŷ lies within the envelope of the measurement, from `y_min` to `y_max`",
    ),
    (
        "nats",
        "natural logarithm of the Bayes factor: the model with the candidate against the model without it",
    ),
    (
        "noise",
        "the standard error `y_sd` of the averaged y, rms; without it, estimated from repeats",
    ),
    (
        "outcome",
        "screened only: the candidate was rated by a first-order prediction or a brief fit and was too weak to be refitted",
    ),
    (
        "p",
        "family-wise: upper bound of the probability that the best of all candidates has this much evidence although no \
         effect is present",
    ),
    (
        "ε",
        "square root of the sum of (y − ŷ)² over the samples; eq. (9)",
    ),
    ("ρ", "correlation coefficient of y and ŷ; eq. (11)"),
];

/// The head of a column; one of [`HEADS`] shows its explanation under the mouse.
fn head(name: &str) -> String {
    let known = HEADS.iter().find(|(head, _)| *head == name);
    known.map_or_else(
        || inline(name),
        |(_, meaning)| {
            let meaning = escape(&meaning.replace('`', ""));
            format!("<abbr title=\"{meaning}\">{}</abbr>", inline(name))
        },
    )
}

/// Escaped text with `` `code` `` marked; a backtick without a partner stays.
fn inline(text: &str) -> String {
    let mut marked = String::with_capacity(text.len() + 16);
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('`') {
        let Some((code, tail)) = after.split_once('`') else {
            break;
        };
        let _ = write!(marked, "{}<code>{}</code>", escape(before), escape(code));
        rest = tail;
    }
    marked.push_str(&escape(rest));
    marked
}

const STYLE: &str = "\
*{box-sizing:border-box}\
body{margin:0;background:var(--paper);color:var(--ink);\
font:16px/1.55 system-ui,-apple-system,'Segoe UI',Helvetica,Arial,sans-serif}\
main{max-width:948px;margin:0 auto;padding:28px 24px 48px}\
h1{font-size:1.75rem;line-height:1.2;margin:0}\
h2{font-size:1.25rem;margin:2.2em 0 .5em;padding-bottom:.25em;border-bottom:1px solid var(--rule)}\
h3{font-size:1.05rem;margin:1.6em 0 .4em}\
p,ul{margin:.6em 0;max-width:46em}\
.subtitle{color:var(--muted);margin:.3em 0 0}\
a{color:var(--link)}\
nav ul{display:flex;flex-wrap:wrap;gap:.2em 1.2em;list-style:none;padding:0;margin:1em 0;font-size:.92rem;max-width:none}\
code,pre{font-family:ui-monospace,'SF Mono',Menlo,Consolas,monospace;font-size:.88em}\
code{background:var(--soft);padding:.1em .3em;border-radius:4px}\
pre{background:var(--soft);border:1px solid var(--rule);border-radius:6px;padding:12px 14px;overflow-x:auto;line-height:1.4}\
.verdict{border:1px solid var(--rule);border-left:5px solid var(--tone);border-radius:6px;background:var(--soft);padding:12px 18px;margin:20px 0}\
.verdict p{margin:.25em 0}.verdict .headline{font-size:1.3rem;line-height:1.3;font-weight:600;color:var(--tone)}\
.verdict dl{display:grid;grid-template-columns:max-content minmax(0,1fr);gap:4px 14px;margin:.6em 0 .2em}\
.verdict dt{color:var(--muted)}.verdict dd{margin:0}\
.verdict code{overflow-wrap:anywhere}\
summary{cursor:pointer;color:var(--link);min-height:28px;padding:3px 0}\
.fold>summary{font-weight:600;margin:14px 0;padding:6px 12px;border:1px solid var(--rule);border-radius:6px;background:var(--soft)}\
.report{max-width:1760px}\
.listed{display:grid;grid-template-columns:200px minmax(0,1fr);gap:36px}\
.listed>nav{position:sticky;top:0;align-self:start;max-height:100vh;overflow-y:auto;padding:14px 0}\
.listed>nav ul{flex-direction:column;gap:.35em;margin:0}\
section{scroll-margin-top:8px}\
.columns{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,540px),1fr));gap:6px 32px;align-items:start}\
.columns>*,.cell>*{min-width:0}\
.columns>.verdict,.cell>.verdict{margin-top:12px}\
.columns>figure,.cell>figure{margin:8px 0}\
@media(max-width:1050px){.listed{display:block}.listed>nav{position:static;padding:0}.listed>nav ul{flex-direction:row;margin:1em 0}}\
.good{--tone:var(--good)}.finding{--tone:var(--finding)}.warning{--tone:var(--warning)}\
.table{overflow-x:auto;margin:14px 0}\
table{border-collapse:collapse;font-size:.94rem;font-variant-numeric:tabular-nums}\
.caption{color:var(--muted);font-size:.94rem;margin-bottom:0}\
th,td{padding:5px 14px 5px 0;text-align:left;border-bottom:1px solid var(--rule);vertical-align:top}\
th{font-weight:600;border-bottom-width:2px}th abbr{cursor:help}\
td:first-child{min-width:9em}td:last-child:not(.n){min-width:12em}th.n{white-space:normal!important;min-width:3.2em}\
.n{text-align:right;padding:5px 8px 5px 14px;white-space:nowrap}\
figure{margin:18px 0}\
figure{container-type:inline-size}\
figure svg{display:block;width:100%;max-width:820px;height:auto}\
.narrow{display:none}\
@container (max-width:500px){.wide{display:none}.narrow{display:block}}\
figcaption{color:var(--muted);font-size:.92rem;max-width:48em;margin-top:4px}\
footer{margin-top:3em;border-top:1px solid var(--rule);padding-top:10px;color:var(--muted);font-size:.85rem}\
footer dl{display:grid;grid-template-columns:max-content 1fr;gap:2px 14px;margin:0}\
footer dd{margin:0;overflow-wrap:anywhere}\
@media(max-width:700px){.listed{display:flex;flex-direction:column;gap:0}\
.content,.content>.columns:first-child,.content>.columns:first-child>.cell{display:contents}\
.listed .content>.columns:first-child .verdict{order:-2}.listed>nav{order:-1}\
.content>*,.content>.columns:first-child>*{min-width:0}}\
@media(max-width:600px){main{padding:16px 12px 40px}\
.verdict{padding:10px 12px}.verdict dl{display:block}.verdict dd{margin:0 0 .5em}}\
@page{margin:14mm 13mm}\
@media print{main,.report{max-width:none;padding:0}.listed,.columns{display:block}\
.cell{display:contents}.columns figure{display:inline-block;width:49%;vertical-align:top;margin:6px 0}\
figure svg{width:auto;max-width:520px;max-height:158mm}.columns figure svg{max-width:100%;max-height:98mm}.fold>summary{border:0;padding:0}body{font-size:10pt}\
table,.caption,figcaption{font-size:9pt}th,td{padding-top:3px;padding-bottom:3px}h2{margin-top:1.4em}\
p,ul,figcaption{max-width:none}.columns figcaption{padding-right:10px}\
nav{display:none}figure:has(>.save){padding-bottom:0}\
figure,.verdict,tr{break-inside:avoid}h2,h3,h2+p,.caption,summary{break-after:avoid}.table,pre{overflow:visible}pre{white-space:pre-wrap}}\
";

const LIGHT: &str = "\
--paper:#fff;--ink:#1f2328;--muted:#656d76;--rule:#d8dee4;--control:#818b98;--soft:#f6f8fa;--link:#0072b2;\
--good:#007a59;--finding:#0072b2;--warning:#b34e00;";

const DARK: &str = "\
--paper:#161b22;--ink:#e6edf3;--muted:#9aa3ad;--rule:#30363d;--control:#7d8590;--soft:#1c2330;--link:#4daae8;\
--good:#3ccf9e;--finding:#4daae8;--warning:#ff8a4c;";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::canvas::draw;

    fn sample() -> String {
        let mut report = Report::new("A <b> & \"c\"", "of `data.csv`");
        report
            .answer(
                Tone::Warning,
                "x < y",
                &[("Evidence", "because & so"), ("Next", "a <b>")],
                &["n <i>"],
            )
            .columns()
            .cell()
            .end_columns()
            .end_columns()
            .fold("more <b>")
            .end_fold()
            .section("One")
            .paragraph("`host-fit <x>` and a lone ` tick \u{0}")
            .table(
                "t",
                &[Column::Text("a<"), Column::Number("b")],
                &[vec!["<i>"], vec!["x", "1", "dropped"]],
            )
            .figure(&draw("d", |_| 30.0), "c & d")
            .code("if a < b {} <script>alert(1)</script>")
            .list(&["p", "<q>"])
            .provenance("seed", "<1>");
        for heading in ["Two", "Three", "Four"] {
            report.section(heading).subsection("sub");
        }
        report.html()
    }

    #[test]
    fn heads_are_explained_as_in_the_glossary() {
        let page = include_str!("../../../docs/glossary.md");
        for (name, meaning) in HEADS {
            let meaning = meaning.rsplit_once(": ").map_or(meaning, |(_, last)| last);
            assert!(page.contains(meaning), "{name}: {meaning}");
        }
        assert!(head("ρ").starts_with("<abbr title="));
        assert_eq!(head("record"), "record");
    }

    #[test]
    fn everything_is_escaped() {
        let html = sample();
        for raw in ["<b>", "<i>", "<script>", "<q>", "<1>", "\u{0}"] {
            assert!(!html.contains(raw), "{raw}");
        }
        assert!(html.contains("<code>host-fit &lt;x&gt;</code> and a lone ` tick \u{fffd}"));
        assert!(html.contains("&lt;script&gt;"));
        assert!(!html.contains("dropped"));
    }

    #[test]
    fn the_page_is_well_formed_and_fetches_nothing() {
        let html = sample();
        // Apart from void elements, the page is XML too: every tag is closed, in order.
        let body = html.split_once("<body>").unwrap().1;
        let body = body.split_once("</body>").unwrap().0;
        let document = roxmltree::Document::parse(body).expect("balanced tags");
        let sections = document.descendants().filter(|n| n.has_tag_name("section"));
        assert_eq!(sections.count(), 4);
        for link in document.descendants().filter_map(|n| n.attribute("href")) {
            let target = link.strip_prefix('#').expect("links stay on the page");
            assert!(
                document
                    .descendants()
                    .any(|n| n.attribute("id") == Some(target))
            );
        }
        for word in [
            "@import",
            "fetch(",
            "XMLHttpRequest",
            "import(",
            "WebSocket",
            "sendBeacon",
        ] {
            assert!(!html.contains(word), "{word}");
        }
        let (head, rest) = html.split_once("<script type=\"module\">").unwrap();
        let (_, rest) = rest.split_once("</script>").unwrap();
        for text in [head, rest] {
            assert!(!text.contains("src=") && !text.contains("url("));
        }
        assert!(html.contains("default-src 'none'"));
    }
}
