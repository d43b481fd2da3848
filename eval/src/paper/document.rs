//! A document of headings, text, tables and figures, as one self-contained page or as Markdown.

use std::{fmt::Write, path::Path};

use super::plot::escape;

/// A document.
#[derive(Debug, Clone, Default)]
pub struct Document {
    /// Its name.
    pub title: String,
    /// From top to bottom.
    pub blocks: Vec<Block>,
}

/// A part of a document. In texts, `` `…` `` is code.
#[derive(Debug, Clone)]
pub enum Block {
    /// A heading below the title.
    Heading(String),
    /// A paragraph.
    Text(String),
    /// Points.
    List(Vec<String>),
    /// A table.
    Table(Table),
    /// Pictures side by side, as far as there is room.
    Figures(Vec<Figure>),
    /// Blocks that [`replace_part`] finds again in the finished page.
    Part {
        /// Letters.
        name: &'static str,
        /// From top to bottom.
        blocks: Vec<Block>,
    },
}

/// A table.
#[derive(Debug, Clone)]
pub struct Table {
    /// Above it.
    pub caption: String,
    /// Names of the columns.
    pub header: Vec<String>,
    /// Cells; the first of each row names it.
    pub rows: Vec<Vec<String>>,
}

/// A picture with what it shows.
#[derive(Debug, Clone)]
pub struct Figure {
    /// Its file in the Markdown's folder.
    pub file: String,
    /// Below it.
    pub caption: String,
    /// The file's bytes.
    pub bytes: Vec<u8>,
}

const CSS: &str = "\
body{font:16px/1.5 system-ui,sans-serif;color:#1a1a1a;background:#fff;max-width:64rem;margin:0 auto;padding:1rem}\
h1{line-height:1.2}h2{margin-top:2.2rem;border-bottom:1px solid #ccc;break-after:avoid}\
.table{overflow-x:auto;margin:1rem 0}table{border-collapse:collapse;font-size:.85rem;font-variant-numeric:tabular-nums}\
caption{text-align:left;font-weight:600;padding:.3rem 0;break-after:avoid}\
th,td{border:1px solid #ccc;padding:.25rem .5rem;text-align:left;vertical-align:top}thead th{background:#f0f0f0}\
tbody th{position:sticky;left:0;background:#fff;max-width:14rem}\
.yes{background:#e3f2dc}.no{background:#fbe0d8}\
@media (max-width:40rem){table{font-size:.75rem}tbody th{max-width:7.5rem}}\
.figures{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(18rem,100%),1fr));gap:1rem;margin:1rem 0}\
figure{margin:0;break-inside:avoid}figure img{width:100%;height:auto;display:block}figcaption{font-size:.85rem}\
code{background:#f3f3f3;padding:0 .2em;overflow-wrap:anywhere}\
@media print{@page{margin:11mm}body{font-size:10pt;max-width:none;padding:0;print-color-adjust:exact}\
.table{overflow:visible}table{font-size:7pt}th,td{padding:1pt 3pt}tbody th{position:static;max-width:none}\
thead{display:table-header-group;break-after:avoid}tr{break-inside:avoid}.figures{grid-template-columns:repeat(3,1fr)}}";

impl Document {
    /// One page that needs no other file.
    pub fn to_html(&self) -> String {
        let title = escape(&self.title);
        let mut page = format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
             <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
             <title>{title}</title><style>{CSS}</style></head><body>\n<h1>{title}</h1>\n"
        );
        for block in &self.blocks {
            page.push_str(&html_block(block));
            page.push('\n');
        }
        page.push_str("</body></html>\n");
        page
    }

    /// Text beside the files of [`Document::figures`].
    pub fn to_markdown(&self) -> String {
        let blocks: Vec<String> = self.blocks.iter().map(markdown_block).collect();
        format!("# {}\n\n{}\n", self.title, blocks.join("\n\n"))
    }

    /// All figures.
    pub fn figures(&self) -> Vec<&Figure> {
        figures_of(&self.blocks)
    }
}

fn figures_of(blocks: &[Block]) -> Vec<&Figure> {
    let figures = blocks.iter().map(|block| match block {
        Block::Figures(figures) => figures.iter().collect(),
        Block::Part { blocks, .. } => figures_of(blocks),
        _ => Vec::new(),
    });
    figures.flatten().collect()
}

/// A page or Markdown with a part as it is in another one; `None` if one of the two does not have it.
pub fn replace_part(page: &str, name: &str, other: &str) -> Option<String> {
    let (_, part, _) = split_part(other, name)?;
    let (before, _, after) = split_part(page, name)?;
    Some([before, part, after].concat())
}

/// What is before a part, the part with its marks, and what is after it.
fn split_part<'a>(page: &'a str, name: &str) -> Option<(&'a str, &'a str, &'a str)> {
    let [begin, end] = part_marks(name);
    let start = page.find(&begin)?;
    let stop = page[start..].find(&end)? + start + end.len();
    Some((&page[..start], &page[start..stop], &page[stop..]))
}

/// Comments around a part, in HTML as well as in Markdown.
fn part_marks(name: &str) -> [String; 2] {
    ["begin", "end"].map(|end| format!("<!-- {end} {name} -->"))
}

fn html_block(block: &Block) -> String {
    match block {
        Block::Heading(text) => format!("<h2>{}</h2>", escape(text)),
        Block::Text(text) => format!("<p>{}</p>", html_text(text)),
        Block::List(points) => {
            let points: Vec<String> = points.iter().map(|point| html_text(point)).collect();
            format!("<ul><li>{}</li></ul>", points.join("</li><li>"))
        }
        Block::Table(table) => html_table(table),
        Block::Figures(figures) => {
            let figures: String = figures.iter().map(html_figure).collect();
            format!("<div class=\"figures\">{figures}</div>")
        }
        Block::Part { name, blocks } => marked(name, blocks.iter().map(html_block), "\n"),
    }
}

fn marked(name: &str, blocks: impl Iterator<Item = String>, gap: &str) -> String {
    let [begin, end] = part_marks(name);
    let lines: Vec<String> = [begin].into_iter().chain(blocks).chain([end]).collect();
    lines.join(gap)
}

fn html_table(table: &Table) -> String {
    let mut html = format!(
        "<div class=\"table\"><table><caption>{}</caption><thead><tr>",
        html_text(&table.caption)
    );
    for name in &table.header {
        let _ = write!(html, "<th scope=\"col\">{}</th>", html_text(name));
    }
    html.push_str("</tr></thead><tbody>");
    for row in &table.rows {
        html.push_str("<tr>");
        for (column, cell) in row.iter().enumerate() {
            let text = html_text(cell);
            let class = match cell.split([',', ' ', ':']).next() {
                Some("yes") => " class=\"yes\"",
                Some("no") => " class=\"no\"",
                _ => "",
            };
            let _ = match column {
                0 => write!(html, "<th scope=\"row\">{text}</th>"),
                _ => write!(html, "<td{class}>{text}</td>"),
            };
        }
        html.push_str("</tr>");
    }
    html.push_str("</tbody></table></div>");
    html
}

fn html_figure(figure: &Figure) -> String {
    let caption = html_text(&figure.caption);
    format!(
        "<figure><img alt=\"{}\" src=\"data:{};base64,{}\"><figcaption>{caption}</figcaption></figure>",
        escape(&figure.caption),
        media_type(&figure.file),
        base64(&figure.bytes)
    )
}

fn media_type(file: &str) -> &'static str {
    match Path::new(file).extension() {
        Some(extension) if extension == "svg" => "image/svg+xml",
        _ => "image/jpeg",
    }
}

/// Escapes, and makes code of what stands between back-ticks.
fn html_text(text: &str) -> String {
    let parts = text.split('`').enumerate();
    parts
        .map(|(number, part)| match number % 2 {
            0 => escape(part),
            _ => format!("<code>{}</code>", escape(part)),
        })
        .collect()
}

fn markdown_block(block: &Block) -> String {
    match block {
        Block::Heading(text) => format!("## {text}"),
        Block::Text(text) => text.clone(),
        Block::List(points) => {
            let points: Vec<String> = points.iter().map(|point| format!("- {point}")).collect();
            points.join("\n")
        }
        Block::Table(table) => markdown_table(table),
        Block::Figures(figures) => {
            let row = |cell: &dyn Fn(&Figure) -> String| {
                let cells: Vec<String> = figures.iter().map(cell).collect();
                format!("| {} |", cells.join(" | "))
            };
            let rule = row(&|_| "---".to_owned());
            let images = row(&|figure| format!("![{}]({})", cell(&figure.caption), figure.file));
            let captions = row(&|figure| cell(&figure.caption));
            format!("{images}\n{rule}\n{captions}")
        }
        Block::Part { name, blocks } => marked(name, blocks.iter().map(markdown_block), "\n\n"),
    }
}

fn markdown_table(table: &Table) -> String {
    let row = |cells: &[String]| {
        let cells: Vec<String> = cells.iter().map(|text| cell(text)).collect();
        format!("| {} |", cells.join(" | "))
    };
    let rule: Vec<String> = table.header.iter().map(|_| "---".to_owned()).collect();
    let rows: Vec<String> = table.rows.iter().map(|cells| row(cells)).collect();
    format!(
        "**{}**\n\n{}\n{}\n{}",
        table.caption,
        row(&table.header),
        row(&rule),
        rows.join("\n")
    )
}

/// A cell must not end where its text has a bar.
fn cell(text: &str) -> String {
    text.replace('|', "\\|")
}

/// RFC 4648.
fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let byte = |place: usize| u32::from(chunk.get(place).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for digit in 0..4 {
            let code = ALPHABET[(bits >> (18 - 6 * digit) & 63) as usize];
            text.push(if digit <= chunk.len() {
                char::from(code)
            } else {
                '='
            });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_standard() {
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
    }

    fn document() -> Document {
        Document {
            title: "A < B".into(),
            blocks: vec![
                Block::Text("run `a < b`".into()),
                Block::Table(Table {
                    caption: "T".into(),
                    header: vec!["x".into(), "y".into()],
                    rows: vec![vec!["a|b".into(), "no, 1 of 2".into()]],
                }),
                Block::Figures(vec![Figure {
                    file: "f.svg".into(),
                    caption: "C".into(),
                    bytes: b"foo".to_vec(),
                }]),
            ],
        }
    }

    #[test]
    fn a_page_holds_its_pictures_and_escapes_its_text() {
        let html = document().to_html();
        for part in [
            "<h1>A &lt; B</h1>",
            "<code>a &lt; b</code>",
            "<td class=\"no\">no, 1 of 2</td>",
            "data:image/svg+xml;base64,Zm9v",
        ] {
            assert!(html.contains(part), "{part} is not in {html}");
        }
        assert!(!html.contains("http://") && !html.contains("https://"));
    }

    #[test]
    fn markdown_names_its_pictures_and_keeps_cells_together() {
        let markdown = document().to_markdown();
        for part in ["# A < B\n", "| a\\|b | no, 1 of 2 |", "![C](f.svg)"] {
            assert!(markdown.contains(part), "{part} is not in {markdown}");
        }
    }
}
