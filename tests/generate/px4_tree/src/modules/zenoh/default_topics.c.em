// publishers: name, uORB topic, instance, options
@[for each in publications]@
@[if each['pub_options_str']]@
pub @(each['topic']) @(each['topic_simple']) 0 @(each['pub_options_str'])
@[else]@
pub @(each['topic']) @(each['topic_simple']) 0
@[end if]@
@[end for]@
@[for each in subscriptions]@
sub @(each['topic']) @(each['topic_simple']) 0
@[end for]@
@[for each in subscriptions_multi]@
sub @(each['topic']) @(each['topic_simple']) -1
@[end for]@
